/* Figures over one axis: zoom (drag, buttons, double-click for all) and values under the pointer.
   Curves and boxes work without this script. */
document.querySelectorAll('.chart').forEach((chart) => {
  'use strict';
  const end = parseFloat(chart.dataset.end);
  const panels = [...chart.querySelectorAll('svg')];
  const axis = chart.querySelector('.axis');
  const TICKS = 6;                                       // numbers below the figure, about
  let view = [0, end];
  chart.querySelectorAll('.zoom, .zoom-note').forEach((part) => { part.hidden = false; });

  function show(low, high) {
    const span = Math.min(Math.max(high - low, end / 1e4), end);
    low = Math.min(Math.max(low, 0), end - span);
    view = [low, low + span];
    for (const svg of panels) svg.setAttribute('viewBox', `${low} 0 ${span} 1000`);
    chart.querySelectorAll('.marks b').forEach((mark) => {
      const share = (mark.dataset.x - low) / span;
      mark.style.left = `${100 * share}%`;
      mark.hidden = share < 0 || share > 1;
    });
    const raw = span / TICKS;
    const unit = 10 ** Math.floor(Math.log10(raw));
    const step = unit * [1, 2, 5, 10].find((factor) => factor * unit >= raw);
    const digits = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
    axis.replaceChildren();
    for (let n = Math.ceil(low / step - 1e-9); n * step <= low + span + 1e-9 * step; n += 1) {
      const tick = document.createElement('span');
      tick.className = 'tick';
      tick.textContent = (n * step).toFixed(digits);
      tick.style.left = `${100 * (n * step - low) / span}%`;
      axis.append(tick);
    }
  }

  function points(path) {                                // [[x, y], ...], read from the path once
    path.points ??= [...path.getAttribute('d').matchAll(/[ML]([-\d.e+]+) ([-\d.]+)/g)]
      .map((m) => [parseFloat(m[1]), parseFloat(m[2])]);
    return path.points;
  }

  function value(path, x, svg) {
    const all = points(path);
    let [from, to] = [0, all.length - 1];
    while (to - from > 1) {
      const middle = (from + to) >> 1;
      if (all[middle][0] <= x) from = middle; else to = middle;
    }
    if (!all.length || x < all[0][0] || x > all.at(-1)[0]) return null;
    const nearest = all[Math.abs(all[from][0] - x) <= Math.abs(all[to][0] - x) ? from : to];
    const [low, high] = [parseFloat(svg.dataset.low), parseFloat(svg.dataset.high)];
    return high - nearest[1] / 1000 * (high - low);
  }

  function read(x) {
    for (const svg of panels) {
      svg.querySelector('.cursor').setAttribute('d', x === null ? '' : `M${x} 0V1000`);
      const line = svg.parentElement.previousElementSibling.querySelector('.read');
      line.replaceChildren();
      if (x === null) continue;
      line.append(`at ${x.toPrecision(4)}: `);
      for (const path of svg.querySelectorAll('path.line')) {
        const found = getComputedStyle(path).display === 'none' ? null : value(path, x, svg);
        if (found === null) continue;
        const key = document.createElement('span');
        key.className = 'key';
        key.title = path.dataset.name;
        key.style.cssText = path.style.cssText;
        line.append(key, `${parseFloat(found.toPrecision(3))} `);
      }
    }
  }

  const place = (event) => {
    const box = panels[0].getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return view[0] + share * (view[1] - view[0]);
  };
  let pressed = null;
  for (const svg of panels) {
    svg.addEventListener('pointermove', (event) => read(place(event)));
    svg.addEventListener('pointerleave', () => read(null));
    svg.addEventListener('pointerdown', (event) => {
      read(place(event));
      if (event.pointerType === 'mouse') pressed = place(event);
    });
    svg.addEventListener('dblclick', () => show(0, end));
  }
  window.addEventListener('pointerup', (event) => {
    if (pressed === null) return;
    const [low, high] = [pressed, place(event)].sort((a, b) => a - b);
    pressed = null;
    if (high - low > 0.01 * (view[1] - view[0])) show(low, high);
  });
  if (!chart.querySelector('.zoom')) return;
  const [closer, wider, earlier, later, all] = chart.querySelectorAll('.zoom button');
  const move = (scale, shift) => {
    const [middle, half] = [(view[0] + view[1]) / 2, (view[1] - view[0]) / 2];
    show(middle + half * (shift - scale), middle + half * (shift + scale));
  };
  closer.addEventListener('click', () => move(0.5, 0));
  wider.addEventListener('click', () => move(2, 0));
  earlier.addEventListener('click', () => move(1, -1));
  later.addEventListener('click', () => move(1, 1));
  all.addEventListener('click', () => show(0, end));
});
