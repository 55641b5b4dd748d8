# SPDX-License-Identifier: Apache-2.0
"""Task allocation: problem arrays, construction, the bee colony with chained Q-learning, search.

Equation numbers refer to: Qi Dai, Bing He, Junchao Zhao, Ming Li, "Multi-UAV task allocation based
on Q-learning algorithm", Rocket Army Engineering University, Xi'an.
"""
