// SPDX-License-Identifier: Apache-2.0
// Mouse, touch and keyboard on the map. One finger scrolls the page; two move the map.
const CLICK = 5;      // [px] that a click may move
const KEY_STEP = 80;  // [px] of an arrow key
const KEY_ZOOM = 1.5;
const STEPS = {ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};

// A wheel moves the page where the page is longer than the window.
const pageScrolls = () => document.documentElement.scrollHeight > innerHeight + 1;

// act: {pan(dx, dy), zoom(factor, x, y), fit(), click(x, y), hover(x, y), leave()}, in [px] of
// `node`.
export function listen(node, act) {
  const at = event => {
    const box = node.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  listenToMouse(node, act, at);
  listenToFingers(node, act, at);
  node.addEventListener('keydown', event => {
    const {key} = event, middle = [node.clientWidth / 2, node.clientHeight / 2];
    const step = STEPS[key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (step) act.pan(KEY_STEP * step[0], KEY_STEP * step[1]);
    else if (key === '+' || key === '=') act.zoom(KEY_ZOOM, ...middle);
    else if (key === '-') act.zoom(1 / KEY_ZOOM, ...middle);
    else if (key === '0' || key === 'Home') act.fit();
    else return;
    event.preventDefault();
  });
}

function listenToMouse(node, act, at) {
  let start = null, last = null;
  node.addEventListener('pointerdown', event => {
    if (event.pointerType === 'touch' || event.button !== 0) return;
    if (event.target.closest('button')) return;  // a captured click would not reach it
    start = last = at(event);
    node.setPointerCapture(event.pointerId);
  });
  node.addEventListener('pointermove', event => {
    if (event.pointerType === 'touch') return;
    const here = at(event);
    if (!start) return act.hover(...here);
    if (last !== start || Math.hypot(here[0] - start[0], here[1] - start[1]) > CLICK) {
      act.pan(here[0] - last[0], here[1] - last[1]);
      last = here;
    }
  });
  const end = () => { start = last = null; };
  node.addEventListener('pointerup', event => {
    if (start && last === start) act.click(...at(event));
    end();
  });
  node.addEventListener('pointercancel', end);
  node.addEventListener('pointerleave', () => act.leave());
  node.addEventListener('dblclick', () => act.fit());
  node.addEventListener('wheel', event => {
    if (pageScrolls() && !event.ctrlKey) return;
    event.preventDefault();
    const unit = event.deltaMode ? 30 : 1;  // a line, or a pixel
    act.zoom(Math.exp(-event.deltaY * unit / 400), ...at(event));
  }, {passive: false});
}

function listenToFingers(node, act, at) {
  let last = null, tap = null;
  const read = event => {
    const [[ax, ay], [bx, by]] = [...event.touches].slice(0, 2).map(at);
    return {x: (ax + bx) / 2, y: (ay + by) / 2, span: Math.hypot(ax - bx, ay - by) || 1};
  };
  node.addEventListener('touchstart', event => {
    tap = event.touches.length === 1 ? at(event.touches[0]) : null;
    last = event.touches.length === 2 ? read(event) : null;
    if (last) event.preventDefault();
  }, {passive: false});
  node.addEventListener('touchmove', event => {
    tap = null;
    if (!last || event.touches.length !== 2) return;
    event.preventDefault();
    const now = read(event);
    act.pan(now.x - last.x, now.y - last.y);
    act.zoom(now.span / last.span, now.x, now.y);
    last = now;
  }, {passive: false});
  node.addEventListener('touchend', event => {
    if (tap && !event.touches.length) act.click(...tap);
    tap = last = null;
  });
  node.addEventListener('touchcancel', () => { tap = last = null; });
}
