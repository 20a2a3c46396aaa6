/* A figure over time: colours from the page, traces on and off, one layout for wide and narrow. */
(function () {
  'use strict';
  const data = JSON.parse(document.getElementById('figure-data').textContent);
  const figure = document.getElementById('figure');
  const controls = document.getElementById('controls');
  const dark = window.matchMedia('(prefers-color-scheme: dark)');
  const NARROW = 600;                                    // width of a phone [px]
  const on = Object.fromEntries(data.switches.map((entry) => [entry.key, entry.on]));
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const shade = (light) => (dark.matches && data.dark[light]) || light;
  const keys = [];
  const isNarrow = () => window.innerWidth < NARROW;
  const panels = Object.keys(data.layout).filter((name) => /^yaxis/.test(name)).length;

  function traces() {
    return data.traces.map((trace) => {
      const visible = trace.meta.switches.every((key) => on[key]);
      const copy = { type: 'scatter', ...trace, visible, line: { ...trace.line } };
      copy.line.color = trace.meta.ink ? colour('--ink') : shade(copy.line.color);
      return copy;
    });
  }

  function layout() {
    const narrow = isNarrow();
    const made = JSON.parse(JSON.stringify(data.layout));
    const size = narrow ? 12 : 13;
    Object.assign(made, {
      height: 80 + panels * (narrow ? 168 : 184),
      margin: { l: narrow ? 46 : 62, r: 10, t: narrow ? 52 : 40, b: 46 },
      font: { color: colour('--ink'), size, family: 'system-ui, "Segoe UI", Roboto, Arial, sans-serif' },
      paper_bgcolor: 'rgba(0,0,0,0)',
      plot_bgcolor: 'rgba(0,0,0,0)',
      hoverlabel: { bgcolor: colour('--paper'), bordercolor: colour('--line'), font: { size: 12 } },
      modebar: { bgcolor: 'rgba(0,0,0,0)', color: colour('--soft'), activecolor: colour('--link') },
      dragmode: narrow ? false : 'zoom',                 // a finger scrolls the page
    });
    for (const key of Object.keys(made).filter((name) => /^[xy]axis/.test(name))) {
      Object.assign(made[key], {
        gridcolor: colour('--line'), zerolinecolor: colour('--line'), tickfont: { size: 12 },
      });
      if (narrow && key !== 'xaxis') made[key].fixedrange = true;
    }
    made.xaxis.spikecolor = colour('--soft');
    for (const shape of made.shapes) {
      shape.fillcolor = colour('--bad');
      shape.opacity = 0.13;
      shape.line = { width: 0 };
    }
    for (const note of made.annotations) {
      note.font = { size, color: note.name === 'warning' ? colour('--bad') : colour('--ink') };
      if (note.name !== 'warning') continue;
      note.bgcolor = colour('--paper');
      if (narrow) note.text = note.short;
    }
    if (figure.layout && figure.layout.xaxis && figure.layout.xaxis.range) {
      made.xaxis.range = figure.layout.xaxis.range.slice();
    }
    return made;
  }

  function draw() {
    for (const [key, light] of keys) key.style.background = shade(light);
    const buttons = isNarrow()
      ? [['zoomIn2d', 'zoomOut2d', 'pan2d', 'resetScale2d']]
      : [['zoom2d', 'pan2d', 'zoomIn2d', 'zoomOut2d', 'resetScale2d', 'toImage']];
    Plotly.react(figure, traces(), layout(), {
      responsive: true, displaylogo: false, scrollZoom: false,
      displayModeBar: true, modeBarButtons: buttons,
    });
  }

  function box(entry) {
    const label = document.createElement('label');
    const input = document.createElement('input');
    input.type = 'checkbox';
    input.checked = entry.on;
    input.addEventListener('change', () => { on[entry.key] = input.checked; draw(); });
    label.append(input);
    if (entry.colour) {
      const key = document.createElement('span');
      key.className = 'key';
      keys.push([key, entry.colour]);
      label.append(key);
    }
    label.append(entry.text);
    controls.append(label);
  }

  data.switches.forEach(box);
  draw();
  dark.addEventListener('change', draw);
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if ((window.innerWidth < NARROW) !== (width < NARROW)) draw();
    width = window.innerWidth;
  });
}());
