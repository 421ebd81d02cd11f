"use strict";
(() => {
const {abs, ceil, cos, floor, log10, max, min, round, sin, PI} = Math, DEG = PI / 180, INK = "#333333";
const pick = (root, selector) => [...root.querySelectorAll(selector)];
// Words reach the page as text and attributes only, never as markup.
const put = (made, attributes, text) => {
    for (const name in attributes) made.setAttribute(name, attributes[name]);
    if (text !== undefined) made.textContent = text;
    return made;
};
const put_in = (parent, made, attributes, text) => { parent?.append(made); return put(made, attributes, text); };
const draw = (parent, name, attributes, text) => put_in(parent, document.createElementNS("http://www.w3.org/2000/svg", name), attributes, text);
const add = (parent, name, attributes, text) => put_in(parent, document.createElement(name), attributes, text);
const on = (target, handlers) => { for (const name in handlers) target.addEventListener(name, handlers[name]); };
const next_frame = requestAnimationFrame;
const press = (button, is) => put(button, {"aria-pressed": is});
const minus = text => text.replace(/-/g, "−");
const raised = n => "×10" + [...String(n)].map(c => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");
const digits = (v, n = 6) => minus(!isFinite(v) ? "–" : v && (abs(v) >= 1e6 || abs(v) < 1e-3) ? v.toExponential(n - 1) : String(+v.toPrecision(n)));
const px = v => round(v * 10) / 10;
const within = (v, a, b) => max(a, min(b, v));

// Numbers: digits (t), even (e), or the first two (h), three (m) or all four (f) bytes of single precision.
const decode = text => {
    const [kind, a, b, n] = text.split(" "), F = Float64Array;
    if (kind === "t") return F.from(text.slice(2).split(" "), Number);
    if (kind === "e") return F.from({length: n}, (_, k) => +a + (b - a) * k / (n - 1));
    const bytes = atob(b), w = {h: 2, m: 3, f: 4}[kind], single = new Uint8Array(bytes.length / w * 4);
    for (let k = 0; k < bytes.length; k++) single[floor(k / w) * 4 + 4 - w + k % w] = bytes.charCodeAt(k);
    return F.from(new Float32Array(single.buffer), v => v * a);
};

const ticks = ({g, s}, [low, high], wanted) => {
    const major = [], minor = [];
    if (g) {
        const span = log10(high / low), stride = ceil(span / wanted);
        // One tick does not show the scale.
        for (const marks of 2 * span <= wanted ? [[1, 2, 5]] : [[1], [1, 2, 5]]) {
            major.length = minor.length = 0;
            for (let n = floor(log10(low)); n <= log10(high); n++)
                for (let m = 1; m < 10; m++) {
                    const v = m * 10 ** n;
                    if (v < low * 0.999999 || v > high * 1.000001) continue;
                    if (!marks.includes(m) || n % stride) minor.push(v);
                    else major.push([v, low >= 1e-3 && high < 1e6 ? String(+v.toPrecision(1)) : m > 1 ? m + raised(n) : raised(n).slice(1)]);
                }
            if (major.length > 2 || span > 1 && major.length > 1) return {major, minor: stride > 1 ? [] : minor, factor: ""};
        }
        major.length = 0;
    }
    const nice = v => { const decade = 10 ** floor(log10(v)); return decade * ([1, 2, 5].find(m => v / decade <= m * 1.000001) ?? 10); };
    const fixed = [s, 2 * s, 4 * s].find(v => within((high - low) / v, 2, 1.6 * wanted) === (high - low) / v);
    let step = fixed ?? nice((high - low) / wanted);
    for (let n = 0; n < 2 && floor(high / step + 1e-9) - ceil(low / step - 1e-9) < 1; n++) step = nice(step / 2.6);
    let power = floor(log10(max(abs(low), abs(high))));
    power = power >= -2 && power < 5 ? 0 : 3 * floor(power / 3);
    const unit = 10 ** power, decimals = within(-floor(log10(step / unit) + 1e-9), 0, 12);
    for (let k = ceil(low / step - 1e-9); k <= high / step + 1e-9 && major.length < 50; k++)
        major.push([k * step, minus((k * step / unit + 0).toFixed(decimals))]);
    return {major, minor: [], factor: power ? raised(power) : ""};
};
const padded = (low, high, log) => {
    if (!(low <= high)) return log ? [0.1, 10] : [-1, 1];
    if (log) { const f = high > low ? (high / low) ** 0.06 : 2; return [low / f, high * f]; }
    const pad = high - low > 1e-12 * abs(high) ? 0.06 * (high - low) : abs(high) / 20 || 1;
    return [low - pad, high + pad];
};
const rising = new WeakMap();
const rises = X => { if (!rising.has(X)) rising.set(X, X.every((v, k) => !k || v >= X[k - 1])); return rising.get(X); };
// Index of the nearest abscissa.
const nearest = (X, x) => {
    if (!rises(X)) return X.reduce((best, v, k) => abs(v - x) < abs(X[best] - x) ? k : best, 0);
    let low = 0, high = X.length - 1;
    while (high - low > 1) { const mid = (low + high) >> 1; if (X[mid] <= x) low = mid; else high = mid; }
    return x - X[low] <= X[high] - x ? low : high;
};
// Lines and bands between their points; anything else at its nearest point.
const at = (curve, x, Y = curve.Y) => {
    const {X} = curve, k = nearest(X, x), j = X[k] < x ? k + 1 : k - 1;
    return "ps".includes(curve.k) || !rises(X) || X[k] === x || !(j in X) || X[j] === X[k] ? Y[k] : Y[k] + (Y[j] - Y[k]) * (x - X[k]) / (X[j] - X[k]);
};
const SHAPES = {s: "m-3-3h6v6h-6z", t: "m0-4l4 7h-8z", v: "m0 4l4-7h-8z", d: "m0-4l4 4-4 4-4-4z", x: "m-3-3l6 6m0-6l-6 6", p: "m-4 0h8m-4-4v8"};
const markers = (parent, points, {m, o}) => {
    const size = within(500 / points.length, 2.8, 6), shape = SHAPES[m]?.replace(/\d/g, v => px(v * size / 6)), filled = shape && !"xp".includes(m);
    draw(parent, "path", {d: points.map(([x, y]) => `M${px(x)} ${px(y)}${shape || "h0"}`).join(""), fill: filled ? o : "none",
        stroke: filled ? "none" : o, "stroke-width": shape ? size / 4 : size, "stroke-linecap": "round"});
};
const stroke = ({o, w, d}, width = w) => ({fill: "none", stroke: o, "stroke-width": width, "stroke-dasharray": d?.join(" ") ?? "none", "stroke-linejoin": "round"});
const choice = (parent, label, options, value, change) => {
    const box = add(add(parent, "label", {}, label + " "), "select");
    for (const [value, text] of options) add(box, "option", {value}, text);
    box.value = value;
    box.onchange = () => change(box.value);
};
const button = (parent, text, onclick) => Object.assign(add(parent, "button", {type: "button"}, text), {onclick});
// The small drawings choose what the large one shows.
const map = (figure, change) => pick(figure, ".map button").forEach((one, k, buttons) => {
    press(one, !k);
    one.onclick = () => {
        buttons.forEach(other => press(other, other === one));
        change(k);
        figure.firstChild.scrollIntoView({block: "nearest"});
    };
});
const begin = svg => {
    const tools = add(null, "div", {class: "tools"}), out = add(null, "output", {class: "values"});
    svg.before(tools);
    svg.after(out);
    return [JSON.parse(svg.querySelector("metadata").textContent), tools, out, svg.closest("figure")];
};
const clear = (svg, width, height) => {
    pick(svg, ":scope > :not(title, metadata)").forEach(child => child.remove());
    put(svg, {viewBox: `0 0 ${width} ${height}`, width, height});
    draw(svg, "rect", {width, height, fill: "#ffffff"});
};

const ORDERS = [["Receptance", "m/N"], ["Mobility", "m/(s·N)"], ["Accelerance", "m/(s²·N)"]];
// Name of the bands around curves with standard errors; a relative error times NEPER is one in dB.
const BAND = "± 2 standard errors", NEPER = 20 * Math.LOG10E;
let clips = 0, printing = false;
const redraws = [];

const plot = svg => {
    const [data, tools, out, figure] = begin(svg), legend = add(null, "div", {class: "keys"}), memory = [], base = clips++;
    svg.before(legend);
    const list = k => k === undefined ? k : memory[k] ??= decode(data.a[k]);
    const first = data.v[0].p.find(p => p.q === "m"), measured = first ? ORDERS.findIndex(([name]) => name === first.y.l) : -1;
    const given = first && /^dB/.test(first.y.u) ? "db" : "log";
    const state = {scale: given, phase: "wrapped", show: "bode", order: measured, log: first?.x.g, view: 0, off: new Set(), x: {}, y: {}, pan: false};
    let frames = [], cursor, seen_at;

    const response = (p, phase) => {
        const {scale, show, order, log} = state, turn = order - measured, w = p.x.u === "rad/s" ? 1 : 2 * PI, [name, unit] = ORDERS[order] ?? [p.y.l, p.y.u.replace("dB re 1 ", "")];
        const curves = p.c.map(c => {
            const X = list(c.x), inDb = given === "db", gain = X.map(x => turn ? (w * x) ** turn : 1), M = list(c.y).map((m, k) => (inDb ? 10 ** (m / 20) : m) * gain[k]);
            return {...c, X, M, P: list(c.p).map(v => v + 90 * turn), E: list(c.e)?.map((e, k) => inDb ? e * M[k] / NEPER : e * gain[k])};
        });
        const part = of => curves.map(c => ({...c, Y: c.M.map((m, k) => m * of(c.P[k] * DEG))}));
        // The error relative to the magnitude, times a factor.
        const share = (c, factor) => c.E?.map((e, k) => e / c.M[k] * factor);
        const x = {...p.x, g: log, r: log === first.x.g ? p.x.r : undefined};
        const panel = (l, u, c, more) => ({h: p.h, x, f: p.f ?? [], c, y: {l, u}, ...more});
        if (show === "reim") return [panel("Real part", unit, part(cos), {t: p.t}), panel("Imaginary part", unit, part(sin))];
        if (show === "nyquist") {
            const real = part(cos);
            return [panel("Imaginary part", unit, part(sin).map((c, k) => ({...c, F: c.X, X: real[k].Y})), {t: p.t, h: 380, f: [], x: {l: "Real part", u: unit}})];
        }
        const db = scale === "db", usual = scale === given && !turn && log === first.x.g;
        let line;
        const near = (v, other) => v - 360 * round((v - other) / 360);
        const angles = curves.map(c => {
            c = {...c, E: share(c, 1 / DEG)};
            if (state.phase === "wrapped") return {...c, Y: c.P.map(v => near(v, 0)), wrap: true};
            let last = 0;
            const turned = {...c, Y: c.P.map(v => last = near(v, last))};
            if (c.k === "l") line = turned;
            return turned;
        });
        if (line) for (const c of angles) if (c.k !== "l") c.Y = c.Y.map((v, k) => near(v, at(line, c.X[k])));
        return [panel("", "", curves.map(c => db ? {...c, Y: c.M.map(m => 20 * log10(m)), E: share(c, NEPER), isDb: true} : {...c, Y: c.M}), {t: p.t, y: {l: name, u: (db ? "dB re 1 " : "") + unit, g: scale === "log", r: usual ? p.y.r : undefined}}),
            panel("Phase", "°", angles, {h: phase?.h ?? p.h, y: {l: "Phase", u: "°", s: 45, r: line ? undefined : [-190, 190], fixed: !line}})];
    };
    const panels = () => data.v[state.view].p.flatMap((p, k, of) => p.q === "m" ? response(p, of[k + 1]) : p.q === "p" ? [] :
        {...p, f: p.f ?? [], c: p.c.map(c => ({...c, X: list(c.x), Y: list(c.y), U: list(c.u), E: list(c.e)}))});
    const shown = panel => panel.c.filter(c => !state.off.has(c.n));
    const extent = (panel, isX, range) => {
        let low = Infinity, high = -Infinity;
        const log = (isX ? panel.x : panel.y).g;
        for (const c of shown(panel)) for (const Z of isX ? [c.X] : [c.Y, c.U ?? []])
            Z.forEach((v, k) => {
                if ((log && !(v > 0)) || !isFinite(v) || (range && (c.X[k] < range[0] || c.X[k] > range[1]))) return;
                low = min(low, v);
                high = max(high, v);
            });
        return isX && low < high && !panel.c.some(c => c.F || c.k !== "l") ? [low, high] : padded(low, high, log);
    };
    const key = ({l, u}) => l + "|" + u;
    const scaled = ([low, high], log, from, to) => {
        const f = log ? log10 : v => v, a = f(low), slope = (to - from) / (f(high) - a);
        return Object.assign(v => from + (f(v) - a) * slope, {back: p => { const v = a + (p - from) / slope; return log ? 10 ** v : v; }});
    };

    const render = () => {
        // On paper three figures share a row.
        const view = data.v[state.view], width = printing ? max(data.w < 500 && pick(figure.parentNode, ":scope > :not(.wide)").length === 3 ? 360 : data.w, 300 * view.c) : max(280, round(svg.getBoundingClientRect().width));
        const all = panels(), columns = within(min(view.c, floor(width / 300)), 1, all.length), rows = ceil(all.length / columns);
        // A page of paper holds all panels; on a screen a wide panel is not flat.
        for (const p of all) p.h = printing ? min(0.88 * p.h, max(60, (data.v[1] ? 300 : 1.15 * width) / rows - 50)) : within(0.22 * width / columns, p.h, 2.2 * p.h);
        const fit = (low, high, step) => within((high - low) / step, 2, 9);
        const ranges = all.map((p, n) => {
            const zoomed = state.x[key(p.x)], x = zoomed ?? p.x.r ?? extent(p, 1);
            return [x, state.y[n] ?? (p.y.fixed || p.y.l === "Coherence" || !(zoomed || state.off.size) ? p.y.r : undefined) ?? extent(p, 0, x)];
        });
        const labels = max(2, ...all.flatMap((p, n) => ticks(p.y, ranges[n][1], fit(0, p.h, 42)).major.map(t => t[1].length))) * 6.6;
        frames = [];
        let top = 6;
        for (let row = 0; row < all.length; row += columns) {
            const some = all.slice(row, row + columns), below = all[row + columns], last = !below || !view.s || key(below.x) !== key(some[0].x);
            const head = some.some(p => p.t) ? 22 : 16, height = max(...some.map(p => p.h)), bottom = top + head + height;
            some.forEach((p, column) => {
                const n = row + column, room = width / columns;
                let [xs, ys] = ranges[n];
                const left = column * room + 32 + labels, right = (column + 1) * room - 14;
                if (p.c[0]?.F && !state.x[key(p.x)]) {
                    const unit = max((xs[1] - xs[0]) / (right - left), (ys[1] - ys[0]) / height) / 2;
                    [xs, ys] = [[xs, right - left], [ys, height]].map(([[a, b], long]) => [(a + b) / 2 - unit * long, (a + b) / 2 + unit * long]);
                }
                frames.push({p, n, left, right, top: top + head, bottom, xs, ys, last, labels, fit, X: scaled(xs, p.x.g, left, right), Y: scaled(ys, p.y.g, bottom, top + head)});
            });
            top = bottom + (last ? 46 : 10);
        }
        clear(svg, width, top);
        frames.forEach(panelOf);
        cursor = draw(svg, "g", {class: "cursor"});
        if (seen_at) point(frames.find(f => f.n === seen_at[0]), seen_at[1]);
        keys();
    };
    const label = (parent, x, y, text, more) => draw(parent, "text", {x, y, "font-size": 11.5, "text-anchor": "middle", fill: INK, ...more}, text);
    const panelOf = frame => {
        const {p, left, right, top, bottom, X, Y, xs, ys, last, labels, n, fit} = frame, group = draw(svg, "g", {class: "panel"}), id = `z${base}-${n}`;
        const xt = ticks(p.x, xs, fit(left, right, 70)), yt = ticks(p.y, ys, fit(top, bottom, 42));
        const down = v => `M${px(X(v))} ${top}V${bottom}`, across = v => `M${left} ${px(Y(v))}H${right}`;
        const grid = (x, y, stroke) => draw(group, "path", {d: x.map(down).join("") + y.map(across).join(""), stroke, fill: "none"});
        grid(xt.minor, yt.minor, "#f1f1f1");
        grid(xt.major.map(t => t[0]), yt.major.map(t => t[0]), "#e0e0e0");
        const box = {x: left, y: top, width: right - left, height: bottom - top};
        draw(draw(group, "clipPath", {id}), "rect", box);
        const inside = draw(group, "g", {"clip-path": `url(#${id})`});
        for (const f of p.f) draw(inside, "path", {d: (f.h ? across : down)(f.v), ...stroke(f, 1.1)});
        for (const isBand of [true, false]) for (const c of shown(p)) if ((c.k === "b") === isBand) curve(inside, frame, c);
        draw(group, "rect", {class: "frame", ...box, fill: "transparent", stroke: INK, "stroke-width": 0.9});
        let end = -99;
        for (const [v, text] of last ? xt.major : []) {
            const half = 3.4 * text.length;
            if (X(v) - half < end + 6) continue;
            end = X(v) + half;
            label(group, X(v), bottom + 16, text);
        }
        end = bottom + 99;
        for (const [v, text] of yt.major) if (end - Y(v) > 13) label(group, left - 6, (end = Y(v)) + 4, text, {"text-anchor": "end"});
        const caption = ({l, u}) => u ? `${l} (${u})` : l, big = {"font-size": 13};
        if (last) label(group, (left + right) / 2, bottom + 34, caption(p.x) + (xt.factor && ", " + xt.factor), big);
        label(group, left, top - 5, yt.factor, {"text-anchor": "start"});
        if (p.t) label(group, (left + right) / 2, top - 7, p.t, {...big, "font-weight": "bold"});
        const x = left - labels - 16, y = (top + bottom) / 2, room = floor((bottom - top + 20) / 6.8), text = caption(p.y), {l, u} = p.y;
        // The unit stays whole.
        draw(label(group, x, y, text.length > room ? caption({l: l.slice(0, max(2, room - u.length - 4)) + "…", u}) : text, {...big, transform: `rotate(-90 ${x} ${y})`}), "title", {}, text);
    };
    const curve = (parent, {X, Y, left, right, top, bottom, xs, ys, p}, c) => {
        const group = draw(parent, "g", {class: "curve", "data-name": c.n ?? ""}), sorted = rises(c.X);
        const low = sorted ? max(0, nearest(c.X, xs[0]) - 1) : 0, high = sorted ? min(c.X.length, nearest(c.X, xs[1]) + 2) : c.X.length;
        // Lowest and highest point of each column of pixels, where there are many.
        const trace = of => {
            const points = [], crowded = sorted && high - low > 4 * (right - left);
            let column, least, most;
            const flush = () => { if (least) points.push(...(least === most ? [most] : least[0] < most[0] ? [least, most] : [most, least])); };
            for (let k = low; k < high; k++) {
                const x = X(c.X[k]), y = Y(of(k)), q = [within(x, -1e4, 1e4), isFinite(y) ? within(y, -1e4, 1e4) : 1e4];
                if (!isFinite(x)) continue;
                if (!crowded) { points.push(q); continue; }
                if (floor(x) !== column) { flush(); column = floor(x); least = most = q; }
                if (q[1] < least[1]) least = q;
                if (q[1] > most[1]) most = q;
            }
            if (crowded) flush();
            return points;
        };
        const half = (bottom - top) * 180 / (ys[1] - ys[0]);
        const chain = points => points.map(([x, y], k) => `${!k || (c.wrap && abs(y - points[k - 1][1]) > half) ? "M" : "L"}${px(x)} ${px(y)}`).join("");
        const band = (lower, upper) => draw(group, "path", {d: chain([...trace(lower), ...trace(upper).reverse()]) + "Z", fill: c.o, opacity: 0.22});
        if (c.k === "b") return band(k => c.Y[k], k => c.U[k]);
        const edge = sign => k => c.Y[k] + (c.isDb ? NEPER * Math.log(1 + sign * c.E[k] / NEPER) : sign * c.E[k]);
        if (c.E && !state.off.has(BAND)) {
            let d = "";
            // Circles in a plane, bars where the curve may jump.
            if (c.F || c.wrap) for (let k = low; k < high; k++) {
                const x = px(X(c.X[k])), y = px(Y(edge(2)(k))), tall = px(Y(edge(-2)(k)) - y);
                if (isFinite(x + tall)) d += `M${x} ${y}` + (c.F ? `a.1.1 0 1 0 0 ${tall}a.1.1 0 1 0 0 ${-tall}` : `v${tall}`);
            }
            if (d) draw(group, "path", {d, opacity: 0.22, ...c.F ? {fill: c.o} : {stroke: c.o, "stroke-width": max(1.5, (right - left) / (high - low))}});
            else band(edge(-2), edge(2));
        }
        const points = trace(k => c.Y[k]);
        if (c.k === "s") {
            const foot = px(Y(p.y.g ? ys[0] : within(0, ...ys)));
            draw(group, "path", {d: points.map(([x, y]) => `M${px(x)} ${foot}V${px(y)}`).join(""), ...stroke(c, within((right - left) / points.length / 2, 0.5, 1.3))});
        }
        if ("lk".includes(c.k)) draw(group, "path", {d: chain(points), ...stroke(c)});
        if ("pk".includes(c.k)) markers(group, points.filter(([x]) => x > left - 9 && x < right + 9), c);
    };

    const keys = () => {
        const all = frames.flatMap(({p}) => [...p.f, ...p.c]), banded = all.find(c => c.E);
        if (banded) all.push({...banded, n: BAND, k: "b"});
        const known = new Map(all.filter(c => c.n).map(c => [c.n, c])), names = [...known.keys(), ...state.off].join("\n");
        if (legend.dataset.names === names) return;
        legend.dataset.names = names;
        legend.replaceChildren();
        for (const [name, c] of known) {
            const parts = c.k ? press(button(legend, "", () => {
                state.off.delete(name) || state.off.add(name);
                render();
                pick(legend, "button").find(other => other.textContent === name).focus();
            }), !state.off.has(name)) : add(legend, "span");
            const sample = draw(parts, "svg", {width: 28, height: 12, "aria-hidden": true});
            if (c.k === "b") draw(sample, "rect", {width: 28, height: 12, fill: c.o, opacity: 0.3});
            else if (c.k !== "p") draw(sample, "path", {d: "M0 6H28", ...stroke(c, 1.7)});
            if ("pk".includes(c.k)) markers(sample, [[14, 6]], c);
            parts.append(name);
        }
    };
    const main = panel => shown(panel).find(c => !"lb".includes(c.k)) ?? shown(panel)[0];
    // Values of all curves at an abscissa, or the words of the point below the pointer.
    const point = (frame, x, y) => {
        const {p} = frame, line = (color, name, text) => {
            const row = add(out, "span");
            if (color) add(row, "i").style.background = color;
            add(row, "b", {}, name);
            row.append(" " + text);
        };
        cursor.replaceChildren();
        out.replaceChildren();
        seen_at = 0;
        const show = (c, k) => { line("", p.x.l, digits(c.X[k], 8) + " " + p.x.u); line("", p.y.l, digits(c.Y[k]) + " " + p.y.u); };
        if (p.c.some(c => c.F || c.i)) {
            let least = 600, best;
            for (const c of shown(p)) if (c.F || c.i) c.X.forEach((v, k) => {
                const d = (frame.X(v) - x) ** 2 + (frame.Y(c.Y[k]) - (y ?? 0)) ** 2;
                if (d < least) [least, best] = [d, [c, k]];
            });
            if (!best) return;
            const [c, k] = best;
            draw(cursor, "circle", {cx: frame.X(c.X[k]), cy: frame.Y(c.Y[k]), r: 6, fill: "none", stroke: INK});
            line(c.o, c.n ?? "", c.i ? c.i[k] : digits(c.F[k], 8) + " Hz");
            return show(c, k);
        }
        const lead = main(p);
        if (!lead) return;
        const value = lead.X[nearest(lead.X, frame.X.back(x))], name = key(p.x);
        seen_at = [frame.n, frame.X(value)];
        line("", p.x.l, digits(value, 8) + " " + p.x.u);
        for (const f of frames) {
            const cx = f.X(value), {l, u} = f.p.y;
            if (key(f.p.x) !== name || cx < f.left - 1 || cx > f.right + 1) continue;
            draw(cursor, "path", {d: `M${cx} ${f.top}V${f.bottom}`, stroke: INK});
            for (const c of shown(f.p)) {
                const near = c.X[nearest(c.X, value)], v = at(c, value), cy = f.Y(v), of = c.of ? ` (extremes of ${c.of} points)` : "";
                // A point elsewhere has no value here, nor has a line beyond its ends.
                if (abs(f.X(near) - cx) > 4 && ("ps".includes(c.k) || near === c.X[0] && near > value || near === c.X.at(-1) && near < value)) continue;
                if (isFinite(cy)) draw(cursor, "circle", {cx, cy, r: 3.5, fill: c.o});
                line(c.o, [f.p.t, l, c.n].filter(Boolean).join(", "), digits(v) + (c.U ? " to " + digits(at(c, value, c.U)) : "") + " " + u + (c.E ? ` (${BAND}: ${digits(2 * at(c, value, c.E), 2)})` : "") + of);
            }
        }
    };
    const place = event => {
        const box = svg.getBoundingClientRect(), unit = svg.viewBox.baseVal.width / box.width;
        return [(event.clientX - box.left) * unit, (event.clientY - box.top) * unit];
    };
    const inside = (x, y) => frames.find(f => x >= f.left && x <= f.right && y >= f.top && y <= f.bottom);
    const select = (axis, n, a, b, scale) => { state[axis][n] = [a, b].map(scale.back); };
    let start, waiting;
    // What the pointer has drawn a box around: x, width, y, height.
    const boxed = (x, y) => {
        const {frame: f} = start, to = within(x, f.left, f.right), down = within(y, f.top, f.bottom), flat = abs(y - start.y) < 24;
        return [min(to, start.x), abs(to - start.x), flat ? f.top : min(down, start.y), flat ? f.bottom - f.top : abs(down - start.y), flat];
    };
    const reset = () => { state.x = {}; state.y = {}; render(); };
    put(svg, {tabindex: 0});
    on(svg, {
        pointerdown: event => {
            const [x, y] = place(event), frame = inside(x, y);
            if (!frame || event.button) return;
            start = {x, y, frame, pan: state.pan !== event.shiftKey};
            svg.setPointerCapture(event.pointerId);
        },
        pointermove: event => {
            const [x, y] = place(event);
            waiting ??= next_frame(() => {
                waiting = undefined;
                const frame = start ? start.frame : inside(x, y);
                if (!start) { if (frame) point(frame, x, y); return; }
                pick(svg, ".select").forEach(box => box.remove());
                if (start.pan) {
                    select("x", key(frame.p.x), frame.left - x + start.x, frame.right - x + start.x, frame.X);
                    select("y", frame.n, frame.bottom - y + start.y, frame.top - y + start.y, frame.Y);
                    render();
                    start = {...start, x, y, frame: frames.find(f => f.n === frame.n)};
                    return;
                }
                const [left, width, top, height] = boxed(x, y);
                draw(svg, "rect", {class: "select", x: left, y: top, width, height, fill: INK, opacity: 0.2});
            });
        },
        pointerup: event => {
            pick(svg, ".select").forEach(box => box.remove());
            if (start && !start.pan) {
                const {frame} = start, [x, width, y, height, flat] = boxed(...place(event));
                if (width > 5) {
                    select("x", key(frame.p.x), x, x + width, frame.X);
                    if (flat) delete state.y[frame.n]; else select("y", frame.n, y + height, y, frame.Y);
                    render();
                } else point(frame, ...place(event));
            }
            start = 0;
        },
        pointercancel: () => { start = 0; },
        dblclick: reset,
        keydown: event => {
            const frame = frames.find(f => f.n === seen_at?.[0]) ?? frames[0], step = {ArrowLeft: -1, ArrowRight: 1}[event.key], by = {"+": 0.5, "-": 2}[event.key], c = main(frame.p);
            const middle = seen_at?.[1] ?? (frame.left + frame.right) / 2;
            if (step && c) {
                const k = nearest(c.X, frame.X.back(middle)) + step;
                if (k in c.X) point(frame, frame.X(c.X[k]), frame.Y(c.Y[k]));
            } else if (by) {
                select("x", key(frame.p.x), middle + (frame.left - middle) * by, middle + (frame.right - middle) * by, frame.X);
                render();
            } else if (event.key === "0") reset();
            else return;
            event.preventDefault();
        },
    });
    button(tools, "Reset", reset);
    const pan = press(button(tools, "Pan", () => press(pan, state.pan = !state.pan)), false);
    if (first) {
        const set = (name, label, options) => choice(tools, label, options, state[name], value => { state[name] = name === "order" ? +value : name === "log" ? value === "true" : value; seen_at = 0; reset(); });
        set("show", "Show", [["bode", "magnitude, phase"], ["reim", "real, imaginary"], ["nyquist", "Nyquist"]]);
        set("scale", "Scale", [["log", "log"], ["lin", "linear"], ["db", "dB"]]);
        set("phase", "Phase", [["wrapped", "±180°"], ["continuous", "continuous"]]);
        if (measured >= 0) set("order", "As", ORDERS.map(([name], k) => [k, name.toLowerCase()]));
        set("log", "Frequency", [[false, "linear"], [true, "log"]]);
    }
    map(figure, k => { state.view = k; state.y = {}; out.replaceChildren(); seen_at = 0; render(); });
    return render;
};

// Deflected lines: every point moves as its complex entry turns.
const shapes = svg => {
    const [{w, h, points, lines, names, modes, turn, tilt, colors}, tools, out, figure] = begin(svg);
    const state = {mode: 0, amplitude: 1, phase: 0, running: false, turn, tilt}, ends = [0, 1, 2].map(d => points.map(p => p[d])).map(v => [min(...v), max(...v)]);
    const size = max(...ends.map(([a, b]) => b - a)) || 1;
    const [a, b, tall] = ends.map(([a, b]) => (b - a) / size), flat = Math.hypot(a, b) || 1, unit = min(0.7 * w / flat, 0.8 * h / (tall + 0.45 * flat));
    const project = p => {
        const [x, y, z] = p.map((v, d) => (v - (ends[d][0] + ends[d][1]) / 2) / size), c = cos(state.turn), s = sin(state.turn);
        return [w / 2 + unit * (c * x - s * y), h / 2 - unit * (z * cos(state.tilt) + (s * x + c * y) * sin(state.tilt))];
    };
    clear(svg, w, h);
    const line = (name, stroke, width, more) => draw(svg, "path", {class: name, fill: "none", stroke, "stroke-width": width, "stroke-linecap": "round", ...more});
    const rest = line("rest", colors[0], 1, {"stroke-dasharray": "4 3"}), moved = line("moved", colors[1], 2), dots = line("dots", colors[2], 6);
    const words = points.length <= 40 ? names.map(name => draw(svg, "text", {"font-size": 11.5, fill: INK}, name)) : [];
    const spot = ([x, y]) => px(x) + " " + px(y), path = all => lines.map(([a, b]) => `M${spot(all[a])}L${spot(all[b])}`).join("");
    const render = () => {
        const c = cos(state.phase), s = sin(state.phase), {n, s: shape} = modes[state.mode], factor = 0.16 * size * state.amplitude;
        const now = points.map((p, k) => project(p.map((v, d) => v + factor * (shape[k][2 * d] * c - shape[k][2 * d + 1] * s))));
        put(rest, {d: path(points.map(project))});
        put(moved, {d: path(now)});
        put(dots, {d: now.map(q => `M${spot(q)}h0`).join("")});
        words.forEach((word, k) => put(word, {x: now[k][0] + 7, y: now[k][1] - 6}));
        put(out, {}, n);
        angle.value = state.phase / DEG;
    };
    let last, from;
    const frame = now => {
        if (!state.running) return;
        state.phase = (state.phase + (now - (last ?? now)) * 0.0038) % (2 * PI);
        last = now;
        render();
        next_frame(frame);
    };
    const play = button(tools, "Play", () => {
        put(play, {}, (state.running = !state.running) ? "Pause" : "Play");
        last = undefined;
        next_frame(frame);
    });
    const slider = (label, to, value, change) => {
        const box = add(add(tools, "label", {}, label + " "), "input", {type: "range", min: 0, max: to, step: "any", value});
        box.oninput = () => { change(+box.value); render(); };
        return box;
    };
    const angle = slider("Phase", 360, 0, v => { state.phase = v * DEG; });
    slider("Amplitude", 3, 1, v => { state.amplitude = v; });
    on(svg, {
        pointerdown: event => { from = event; svg.setPointerCapture(event.pointerId); },
        pointerup: () => { from = 0; },
        pointermove: event => {
            if (!from) return;
            state.turn += (event.clientX - from.clientX) / 150;
            state.tilt = within(state.tilt + (event.clientY - from.clientY) / 150, -1.57, 1.57);
            from = event;
            render();
        },
    });
    map(figure, k => { state.mode = k; render(); });
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play.click();
    return render;
};

const sortable = table => pick(table, "thead th").forEach((head, column) => {
    const text = head.textContent;
    put(head, {}, "");
    button(head, text, () => {
        const rows = pick(table, "tbody tr"), up = head.getAttribute("aria-sort") !== "ascending";
        const value = row => { const text = row.cells[column].textContent.replace(/−/g, "-"), n = parseFloat(text); return n === n ? n : text; };
        pick(table, "th").forEach(other => other.removeAttribute("aria-sort"));
        put(head, {"aria-sort": up ? "ascending" : "descending"});
        rows.sort((a, b) => { const [u, v] = [value(a), value(b)]; return (u > v) - (u < v) || typeof u > typeof v; });
        table.tBodies[0].append(...(up ? rows : rows.reverse()));
    });
});
const filtered = section => {
    const items = pick(section, "[data-category]"), names = [...new Set(items.map(item => item.dataset.category))], tools = add(null, "div", {class: "tools"});
    section.querySelector("h2").after(tools);
    choice(tools, "Show", [["", "all"], ...names.map(name => [name, name])], "", value => items.forEach(item => { item.hidden = value && item.dataset.category !== value; }));
};

pick(document, "table.sort").forEach(sortable);
pick(document, "[data-filter]").forEach(filtered);
pick(document, "svg > metadata").forEach(({parentNode: svg}) => {
    // What nobody looks at yet stays as it was drawn.
    const seen = new IntersectionObserver(entries => {
        if (!entries.some(entry => entry.isIntersecting)) return;
        seen.disconnect();
        const isShape = svg.classList.contains("shape"), render = (isShape ? shapes : plot)(svg);
        render();
        if (!isShape) redraws.push(render);
    }, {rootMargin: "200px"});
    seen.observe(svg);
});
let wide = innerWidth;
const redraw = () => redraws.forEach(render => render());
on(window, {
    resize: () => { if (innerWidth !== wide) { wide = innerWidth; redraw(); } },
    beforeprint: () => { printing = true; redraw(); },
    afterprint: () => { printing = false; redraw(); },
});
})();
