/* The drive as one figure: colours from the page, wheels, bands and truth on and off. */
(function () {
  'use strict';
  const data = JSON.parse(document.getElementById('drive-data').textContent);
  const figure = document.getElementById('figure');
  const controls = document.getElementById('controls');
  const dark = window.matchMedia('(prefers-color-scheme: dark)');
  const NARROW = 600;                                    // width of a phone [px]
  const shown = { wheels: data.wheels.map(() => true), band: false, truth: false };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function visible(trace) {
    const { kind, wheel } = trace.meta;
    const on = wheel < 0 || shown.wheels[wheel];
    return on && (kind === 'band' ? shown.band : kind !== 'truth' || wheel < 0 || shown.truth);
  }

  function traces() {
    return data.traces.map((trace) => {
      const copy = { type: 'scatter', ...trace, visible: visible(trace), line: { ...trace.line } };
      if (trace.meta.kind === 'truth') copy.line.color = colour('--ink');
      return copy;
    });
  }

  function layout() {
    const narrow = window.innerWidth < NARROW;
    const made = JSON.parse(JSON.stringify(data.layout));
    const size = narrow ? 12 : 13;
    Object.assign(made, {
      height: narrow ? 920 : 1000,
      margin: { l: narrow ? 46 : 62, r: 10, t: 26, b: 46 },
      font: { color: colour('--ink'), size, family: 'system-ui, "Segoe UI", Roboto, Arial, sans-serif' },
      paper_bgcolor: 'rgba(0,0,0,0)',
      plot_bgcolor: 'rgba(0,0,0,0)',
      hoverlabel: { bgcolor: colour('--paper'), bordercolor: colour('--line'), font: { size: 12 } },
    });
    for (const key of Object.keys(made).filter((name) => /^[xy]axis/.test(name))) {
      Object.assign(made[key], {
        gridcolor: colour('--line'), zerolinecolor: colour('--line'), tickfont: { size: 12 },
      });
    }
    made.xaxis.spikecolor = colour('--soft');
    for (const shape of made.shapes) {
      shape.fillcolor = colour('--bad');
      shape.opacity = 0.13;
      shape.line = { width: 0 };
    }
    for (const note of made.annotations) {
      note.font = { size, color: note.name === 'warning' ? colour('--bad') : colour('--ink') };
      if (note.name === 'warning') note.bgcolor = colour('--paper');
      if (note.name === 'warning' && narrow) note.text = 'stuck warning';
    }
    if (figure.layout && figure.layout.xaxis && figure.layout.xaxis.range) {
      made.xaxis.range = figure.layout.xaxis.range.slice();
    }
    return made;
  }

  function draw() {
    const bar = window.innerWidth < NARROW ? false : 'hover';
    Plotly.react(figure, traces(), layout(), {
      responsive: true, displaylogo: false, displayModeBar: bar, scrollZoom: false,
      modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
    });
  }

  function box(text, checked, change, mark) {
    const label = document.createElement('label');
    const input = document.createElement('input');
    input.type = 'checkbox';
    input.checked = checked;
    input.addEventListener('change', () => { change(input.checked); draw(); });
    label.append(input);
    if (mark) {
      const key = document.createElement('span');
      key.className = 'key';
      key.style.background = mark;
      label.append(key);
    }
    label.append(text);
    label.style.cssText = 'display:inline-block;margin:0 16px 6px 0;font-size:0.92rem;white-space:nowrap';
    controls.append(label);
  }

  data.wheels.forEach((wheel, i) => box(wheel.name, true, (on) => { shown.wheels[i] = on; }, wheel.colour));
  box('± 2 standard deviations', false, (on) => { shown.band = on; });
  if (data.hasTruth) box('truth of each wheel', false, (on) => { shown.truth = on; });
  draw();
  dark.addEventListener('change', draw);
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if ((window.innerWidth < NARROW) !== (width < NARROW)) draw();
    width = window.innerWidth;
  });
}());
