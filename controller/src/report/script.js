// What happens on the page: strips over time, one cursor through strips, tool path and program, and a zoom that all of them share.
"use strict";
(async () => {
  const $ = (selector, from = document) => from.querySelector(selector);
  const all = (selector, from = document) => [...from.querySelectorAll(selector)];
  const packed = $("#data");
  if (!packed) return;

  // The columns, as data.rs packs them.
  const zipped = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([zipped]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const text = new TextDecoder();
  const head = JSON.parse(text.decode(bytes.subarray(4, 4 + length)));
  const data = {};
  let at = 4 + length;
  const source = text.decode(bytes.subarray(at + head.bytes)).split("\n");
  for (const { name, step, count } of head.columns) {
    const values = new Float64Array(count);
    for (let n = 0, before = 0; n < count; n++) {
      let number = 0, scale = 1, byte;
      do {
        byte = bytes[at++];
        number += (byte & 127) * scale;
        scale *= 128;
      } while (byte > 127);
      if (number === 0) { values[n] = NaN; continue; }
      number -= 1;
      before += number % 2 ? -(number + 1) / 2 : number / 2;
      values[n] = before * step;
    }
    data[name] = values;
  }
  const { time, line } = data;
  if (!time.length) return;
  const whole = [time[0], Math.max(time[time.length - 1], time[0] + 1e-3)];
  let view = [...whole];

  // The first row that is not before an instant.
  const row = (t, column = time) => {
    let low = 0, high = column.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (column[middle] < t) low = middle + 1; else high = middle;
    }
    return Math.min(low, column.length - 1);
  };
  const escape = (text) => String(text).replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
  const number = (value, digits = 4) => {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    return size && (size < 1e-3 || size >= 1e7) ? value.toExponential(2)
      : String(+value.toPrecision(size >= 1e4 ? 7 : digits));
  };
  // Round values in a range, about so many.
  const ticks = ([from, to], count) => {
    const rough = (to - from) / count;
    const decade = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((n) => n * decade).find((it) => it >= rough);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const found = [];
    for (let n = Math.ceil(from / step - 1e-9); n * step <= to + step * 1e-9; n++) {
      found.push([n * step, (n * step).toFixed(Math.min(digits, 9)).replace("-", "−")]);
    }
    return found;
  };

  // Strips: a quantity each, under each other, with one time axis.
  const WIDTH = 1120, LEFT = 78, RIGHT = 1108, STRIP = 96, GAP = 24;
  const place = (t) => LEFT + (t - view[0]) / (view[1] - view[0]) * (RIGHT - LEFT);
  const instant = (x) => view[0] + (x - LEFT) / (RIGHT - LEFT) * (view[1] - view[0]);
  const tenth = (value) => Math.round(value * 10) / 10;
  // Where each column of pixels begins among the rows of the view; nothing where there are hardly more rows than columns.
  let columns = { of: "", starts: null };
  const starts = (first, last) => {
    if (columns.of === String(view)) return columns.starts;
    const count = RIGHT - LEFT;
    let found = null;
    if (last - first > 3 * count) {
      found = new Int32Array(count + 2);
      for (let n = 0; n <= count; n++) found[n] = Math.max(first, Math.min(row(instant(LEFT + n)), last));
      found[0] = first;
      found[count + 1] = last + 1;
    }
    columns = { of: String(view), starts: found };
    return found;
  };
  // The places of a line's values: all of them, or the least and the greatest of each column of pixels, in the order in which
  // they come. No peak is lost; a place of -1 is a gap.
  const places = (values, first, last) => {
    const columns = starts(first, last);
    if (!columns) return null;
    const found = new Int32Array(2 * (columns.length - 1));
    for (let n = 0; n + 1 < columns.length; n++) {
      let least = -1, most = -1;
      for (let at = columns[n]; at < columns[n + 1]; at++) {
        const value = values[at];
        if (value !== value) continue;
        if (least < 0 || value < values[least]) least = at;
        if (most < 0 || value > values[most]) most = at;
      }
      found[2 * n] = Math.min(least, most);
      found[2 * n + 1] = Math.max(least, most);
    }
    return found;
  };
  const outline = (values, found, first, last, stepped, y) => {
    let d = "", pen = false;
    if (!found) {
      for (let n = first; n <= last; n++) {
        const value = values[n];
        if (value !== value) { pen = false; continue; }
        const px = tenth(place(time[n])), py = tenth(y(value));
        d += !pen ? `M${px} ${py}` : stepped ? `H${px}V${py}` : `L${px} ${py}`;
        pen = true;
      }
      return d;
    }
    for (let n = 0; n < found.length; n += 2) {
      if (found[n] < 0) { pen = false; continue; }
      const one = tenth(y(values[found[n]])), other = tenth(y(values[found[n + 1]]));
      d += `${pen ? "L" : "M"}${LEFT + n / 2} ${one}`;
      if (other !== one) d += `V${other}`;
      pen = true;
    }
    return d;
  };
  const draw = (box) => {
    const { strips, marks } = box.spec;
    const first = Math.max(row(view[0]) - 1, 0), last = Math.min(row(view[1]) + 1, time.length - 1);
    const foot = strips.length * (STRIP + GAP);
    let svg = "";
    const times = ticks(view, 10);
    strips.forEach((strip, n) => {
      const top = n * (STRIP + GAP) + GAP - 6;
      let least = Infinity, most = -Infinity;
      const found = strip.lines.map(({ column }) => places(data[column], first, last));
      strip.lines.forEach(({ column }, line) => {
        const values = data[column], kept = found[line];
        const count = kept ? kept.length : last - first + 1;
        for (let n = 0; n < count; n++) {
          const value = values[kept ? kept[n] : first + n];
          if (value < least) least = value;
          if (value > most) most = value;
        }
      });
      if (!(least <= most)) least = most = 0;
      // A limit far outside would flatten the data; its value stands in the note.
      const reach = Math.max(Math.abs(least), Math.abs(most));
      const near = strip.limits.filter((it) => Math.abs(it) <= reach * 4);
      if (view[0] === whole[0] && view[1] === whole[1]) {
        least = Math.min(least, ...near);
        most = Math.max(most, ...near);
      }
      const margin = (most - least) * 0.07 || Math.max(Math.abs(most) * 0.1, 1e-6);
      const range = [least - margin, most + margin];
      const y = (value) => top + STRIP - (value - range[0]) / (range[1] - range[0]) * STRIP;
      const keys = strip.lines.filter((it) => it.name)
        .map((it) => `<tspan class=key-${it.class} dx=10>${escape(it.name)}</tspan>`).join("");
      svg += `<text class=name x=${LEFT} y=${top - 5}>${escape(strip.title)} <tspan class=unit>${escape(strip.unit)}</tspan>${keys}</text>`
        + `<text class=note x=${RIGHT} y=${top - 5} text-anchor=end>${escape(strip.note)}</text>`
        + `<rect class=frame x=${LEFT} y=${top} width=${RIGHT - LEFT} height=${STRIP} />`;
      for (const [value, label] of ticks(range, 4)) {
        const py = y(value).toFixed(1);
        svg += `<path class=${value === 0 ? "zero" : "grid"} d='M${LEFT} ${py}H${RIGHT}'/>`
          + `<text class=tick x=${LEFT - 6} y=${+py + 3.5} text-anchor=end>${label}</text>`;
      }
      svg += `<path class=grid d='${times.map(([t]) => `M${place(t).toFixed(1)} ${top}v${STRIP}`).join("")}'/>`;
      svg += `<svg x=${LEFT} y=${top} width=${RIGHT - LEFT} height=${STRIP} viewBox='${LEFT} ${top} ${RIGHT - LEFT} ${STRIP}'>`;
      for (const limit of near) svg += `<path class=limit d='M${LEFT} ${y(limit).toFixed(1)}H${RIGHT}'/>`;
      for (const mark of marks) {
        if (mark.time < view[0] || mark.time > view[1]) continue;
        svg += `<path class=mark d='M${place(mark.time).toFixed(1)} ${top}v${STRIP}'><title>${escape(mark.text)}</title></path>`;
      }
      strip.lines.forEach((it, n) => {
        svg += `<path class='line ${it.class}' d='${outline(data[it.column], found[n], first, last, it.stepped, y)}'/>`;
      });
      svg += "</svg>";
    });
    for (const [t, label] of times) {
      svg += `<text class=tick x=${place(t).toFixed(1)} y=${foot + 16} text-anchor=middle>${label} s</text>`;
    }
    box.innerHTML = `<svg class=chart viewBox='0 0 ${WIDTH} ${foot + 26}' role=img aria-label='${escape(box.spec.label)}'>${svg}`
      + `<rect class=band y=${GAP - 6} height=${foot - GAP + 6} width=0 x=0 /><path class=cursor d='' data-foot=${foot} /></svg>`;
    box.drawn = String(view);
  };
  const boxes = all(".strips");
  for (const box of boxes) box.spec = JSON.parse(box.dataset.spec);
  // What is seen is drawn at once, all else when it comes to sight, or to paper.
  const seen = new Set();
  const redraw = (box) => { if (box.drawn !== String(view)) draw(box); };
  const in_sight = (shown, hidden) => new IntersectionObserver((changes) => {
    for (const { target, isIntersecting } of changes) (isIntersecting ? shown : hidden)(target);
  }, { rootMargin: "200px" });
  const sight = in_sight((box) => { seen.add(box); redraw(box); mark(); }, (box) => seen.delete(box));
  window.addEventListener("beforeprint", () => boxes.forEach(redraw));

  // The tool path: each view says by its matrix where a point of the machine is on it.
  const paths = all("svg[data-matrix]").map((svg) => {
    const m = svg.dataset.matrix.split(" ").map(Number);
    const axes = ["X", "Y", "Z"].map((it) => data[`${it}.set`]);
    const of = (n) => {
      const [x, y, z] = axes.map((it) => (it ? it[n] : 0));
      return [m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]];
    };
    const box = svg.viewBox.baseVal;
    svg.insertAdjacentHTML("beforeend", "<path class=stretch d=''/><circle class=here r=0 />");
    return { svg, of, whole: [box.x, box.y, box.width, box.height], scale: 1, is_seen: false, shown: "" };
  });
  const path_of = (svg) => paths.find((it) => it.svg === svg);
  const paths_in_sight = in_sight(
    (svg) => { path_of(svg).is_seen = true; stretch(); mark(); }, (svg) => { path_of(svg).is_seen = false; });
  paths.forEach(({ svg }) => paths_in_sight.observe(svg));
  const follows = $("#follows");
  const stretch = () => {
    const first = row(view[0]), last = row(view[1]);
    const is_whole = view[0] === whole[0] && view[1] === whole[1];
    const shown = `${view} ${follows && follows.checked}`;
    for (const path of paths) {
      if (!path.is_seen || path.shown === shown) continue;
      path.shown = shown;
      let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
      const parts = [];
      let before = [NaN, NaN];
      const least = (last - first) / 4000;
      for (let n = first; n <= last && !is_whole; n++) {
        const [x, y] = path.of(n);
        x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
        if (least > 1 && Math.abs(x - before[0]) + Math.abs(y - before[1]) < 0.3) continue;
        parts.push(`${parts.length ? "L" : "M"}${x.toFixed(3)} ${y.toFixed(3)}`);
        before = [x, y];
      }
      $(".stretch", path.svg).setAttribute("d", parts.join(""));
      let box = path.whole;
      if (!is_whole && follows && follows.checked) {
        const wide = Math.max(x1 - x0, (y1 - y0) * path.whole[2] / path.whole[3], path.whole[2] / 5000) * 1.3;
        const high = wide * path.whole[3] / path.whole[2];
        box = [(x0 + x1 - wide) / 2, (y0 + y1 - high) / 2, wide, high];
      }
      path.scale = box[2] / path.whole[2];
      path.svg.setAttribute("viewBox", box.join(" "));
      path.svg.classList.toggle("near", path.scale < 0.999);
    }
  };

  const axes = Object.keys(data).filter((it) => it.endsWith(".set")).map((it) => it.slice(0, -4));

  // The program, of which those lines are there that are seen.
  const listing = $("#listing");
  const HIGH = 18;
  // The first block of each line.
  const block_of = new Map();
  data["block.line"].forEach((it, n) => { if (!block_of.has(it)) block_of.set(it, n); });
  const told = (n) => {
    const places = axes.map((axis) => `${axis} ${data[`block.${axis}`][n].toFixed(4)}`);
    return [`ends at ${data["block.end"][n].toFixed(3)} s, ${places.join(" ")}`, `${(1000 * data["block.worst"][n]).toFixed(2)} µm`];
  };
  const list = () => {
    if (!listing) return;
    const first = Math.max(0, Math.floor(listing.scrollTop / HIGH) - 5);
    const last = Math.min(source.length, first + Math.ceil(listing.clientHeight / HIGH) + 10);
    const now = here < 0 ? -1 : line[here];
    let html = "";
    for (let n = first; n < last; n++) {
      const is_here = n + 1 === now ? " class=now" : "";
      const block = block_of.get(n + 1);
      const [end, worst] = block === undefined ? ["", ""] : told(block);
      html += `<div${is_here} data-line=${n + 1} title='${end}' style='top:${n * HIGH}px'><i>${n + 1}</i><b>${worst}</b>${escape(source[n])}</div>`;
    }
    $("div", listing).innerHTML = html;
  };
  if (listing) {
    if (source.length < 2 && !source[0]) listing.parentElement.hidden = true;
    $("div", listing).style.height = `${source.length * HIGH}px`;
    listing.addEventListener("scroll", list);
    listing.addEventListener("click", (event) => {
      const chosen = event.target.closest("[data-line]");
      if (!chosen) return;
      const block = block_of.get(+chosen.dataset.line);
      if (block !== undefined) zoom(block ? data["block.end"][block - 1] : whole[0], data["block.end"][block], true);
    });
  }

  // One cursor through all of it.
  let here = -1;
  const bar = $("#bar");
  const mark = () => {
    const x = here < 0 ? -1 : place(time[here]);
    const is_seen = x >= LEFT && x <= RIGHT;
    for (const box of seen) {
      const cursor = $(".cursor", box);
      if (cursor) cursor.setAttribute("d", is_seen ? `M${x.toFixed(1)} ${GAP - 6}V${cursor.dataset.foot}` : "");
    }
    for (const path of paths) {
      const dot = $(".here", path.svg);
      dot.setAttribute("r", here < 0 ? 0 : 5 * path.scale);
      if (here < 0) continue;
      const [px, py] = path.of(here);
      dot.setAttribute("cx", px);
      dot.setAttribute("cy", py);
    }
  };
  const tell = () => {
    if (here < 0) return;
    const n = here, parts = [`${time[n].toFixed(4)} s`];
    for (const axis of axes) parts.push(`${axis} ${data[`${axis}.set`][n].toFixed(4)}`);
    parts.push(`feed ${number(data.feed[n])}`);
    if (Number.isFinite(data.programmed[n])) parts.push(`of ${number(data.programmed[n])} mm/s`);
    if (Number.isFinite(data.contour_error[n])) parts.push(`off the path ${(1000 * data.contour_error[n]).toFixed(2)} µm`);
    const said = line[n] ? `line ${line[n]}: ${source[line[n] - 1] || ""}` : "";
    $("#where").textContent = parts.join(" · ");
    $("#said").textContent = said;
    if (listing && line[n]) {
      const top = (line[n] - 1) * HIGH;
      if (top < listing.scrollTop + HIGH || top > listing.scrollTop + listing.clientHeight - 3 * HIGH) {
        listing.scrollTop = top - listing.clientHeight / 2;
      }
    }
    list();
  };
  let due = false;
  const point = (n) => {
    if (n === here) return;
    here = n;
    mark();
    if (!due) {
      due = true;
      requestAnimationFrame(() => { due = false; tell(); });
    }
  };
  const zoom = (from, to, shows) => {
    const least = Math.min(10 * (time[1] - time[0] || 1e-3), whole[1] - whole[0]);
    if (to - from < least) [from, to] = [(from + to - least) / 2, (from + to + least) / 2];
    view = [Math.max(from, whole[0]), Math.min(to, whole[1])];
    if (view[1] - view[0] < least) view = [Math.max(whole[0], view[1] - least), view[1]];
    const is_whole = view[0] === whole[0] && view[1] === whole[1];
    bar.classList.toggle("zoomed", !is_whole);
    $("#span").textContent = is_whole ? "" : `${view[0].toFixed(3)} to ${view[1].toFixed(3)} s`;
    for (const box of seen) redraw(box);
    stretch();
    if (shows) point(row((view[0] + view[1]) / 2));
    mark();
  };
  const at_svg = (svg, event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [point.x, point.y];
  };
  for (const box of boxes) {
    let began = null;
    const x_of = (event) => Math.min(Math.max(at_svg($("svg", box), event)[0], LEFT), RIGHT);
    box.addEventListener("pointerdown", (event) => {
      if (event.button || event.pointerType === "touch") return;
      began = x_of(event);
      box.setPointerCapture(event.pointerId);
    });
    box.addEventListener("pointermove", (event) => {
      if (!$("svg", box)) return;
      const x = x_of(event);
      point(row(instant(x)));
      if (began === null) return;
      const band = $(".band", box);
      band.setAttribute("x", Math.min(began, x));
      band.setAttribute("width", Math.abs(x - began));
    });
    box.addEventListener("pointerup", (event) => {
      if (began === null) return;
      const [from, to] = [instant(began), instant(x_of(event))];
      const wide = Math.abs(x_of(event) - began) > 4;
      began = null;
      $(".band", box).setAttribute("width", 0);
      if (wide) zoom(Math.min(from, to), Math.max(from, to));
    });
    box.addEventListener("pointercancel", () => { began = null; });
    box.addEventListener("dblclick", () => zoom(...whole));
  }
  for (const path of paths) {
    path.svg.addEventListener("pointermove", (event) => {
      const [x, y] = at_svg(path.svg, event);
      const first = row(view[0]), last = row(view[1]);
      let nearest = -1, least = (14 * path.scale) ** 2;
      for (let n = first; n <= last; n++) {
        const [px, py] = path.of(n);
        const away = (px - x) ** 2 + (py - y) ** 2;
        if (away < least) { least = away; nearest = n; }
      }
      if (nearest >= 0) point(nearest);
    });
    path.svg.addEventListener("click", () => {
      if (here >= 0) zoom(time[here] - 0.5, time[here] + 0.5);
    });
    path.svg.addEventListener("dblclick", () => zoom(...whole));
  }
  for (const it of all("[data-time]")) {
    it.addEventListener("click", () => {
      const t = +it.dataset.time, half = +it.dataset.half || 0.25;
      zoom(t - half, t + half);
      point(row(t));
    });
  }
  const part = (by) => {
    const middle = here >= 0 && time[here] >= view[0] && time[here] <= view[1] ? time[here] : (view[0] + view[1]) / 2;
    zoom(middle - (middle - view[0]) * by, middle + (view[1] - middle) * by);
  };
  const pan = (by) => {
    const wide = view[1] - view[0];
    const from = Math.min(Math.max(view[0] + by * wide, whole[0]), whole[1] - wide);
    zoom(from, from + wide);
  };
  const acts = { whole: () => zoom(...whole), closer: () => part(0.5), wider: () => part(2), back: () => pan(-0.5), on: () => pan(0.5) };
  for (const it of all("[data-act]")) it.addEventListener("click", acts[it.dataset.act]);
  const keys = { Escape: "whole", "+": "closer", "-": "wider", ArrowLeft: "back", ArrowRight: "on" };
  window.addEventListener("keydown", (event) => {
    if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
      acts[keys[event.key]]();
      event.preventDefault();
    }
  });
  if (follows) follows.addEventListener("change", () => { stretch(); mark(); });
  for (const box of boxes) {
    box.style.aspectRatio = `${WIDTH} / ${box.spec.strips.length * (STRIP + GAP) + 26}`;
    const { top, bottom } = box.getBoundingClientRect();
    if (top < innerHeight && bottom > 0) redraw(box);
    sight.observe(box);
  }
  stretch();
  list();
  bar.hidden = false;
  document.documentElement.dataset.ready = "yes";
})();
