"use strict";
const $ = (id) => document.getElementById(id);
const facts = JSON.parse($("facts").textContent), model = fuzzytree[facts.name];
const { classes = [], rows = [] } = facts; // what is empty is left out
const whole = (one) => ({ parts: [], categories: [], terms: [], unit: "", ...one });
const variables = facts.variables?.map(whole) ?? [], outputs = facts.outputs?.map(whole) ?? [];
const rules = facts.rules ?? facts.blocks.flatMap((block) => block.rules.map((rule) => ({ ...rule, block })));
const inputs = variables.filter((one) => !one.parts.length);
const values = inputs.map((one) => one.start);
const { min, max } = Math;

/* --- elements, numbers and words */

const node = (space, tag, look, parts) => {
  const made = document.createElementNS(`http://www.w3.org/${space}`, tag);
  for (const [name, value] of Object.entries(look)) made.setAttribute(name, value);
  made.append(...parts);
  return made;
};
const make = (tag, look = {}, ...parts) => node("1999/xhtml", tag, look, parts);
const draw = (tag, look, ...parts) => node("2000/svg", tag, look, parts);
const quiet = (...parts) => make("span", { class: "quiet" }, ...parts);
const short = (text) => (text.length > 200 ? `${text.slice(0, 199)}…` : text);
const named = (text) => make("bdi", {}, short(text));
const button = (text, act, look = {}) => {
  const made = make("button", { type: "button", ...look }, text);
  made.addEventListener("click", act);
  return made;
};
const select = (names, look, act) => {
  const box = make("select", look, ...names.map((name, k) => make("option", { value: k }, short(name))));
  box.addEventListener("change", () => act(Number(box.value)));
  return box;
};
const fixed = (x) => (Number.isFinite(x) ? (x > 0 && x < 0.0005 ? "<0.001" : x.toFixed(3)) : "–");
const plain = (x, digits = 6) => (Number.isFinite(x) ? String(Number(x.toPrecision(digits))) : "no number");
const cell = (one, x) => {
  if (!Number.isFinite(x)) return "";
  if (one.categories.length) return one.categories[x] ?? "";
  return one.date ? new Date(Math.round(x * 864e5)).toISOString().slice(0, 10) : String(x);
};
const parsed = (one, text) => {
  if (one.categories.length) return one.categories.includes(text) ? one.categories.indexOf(text) : NaN;
  return one.date ? Date.parse(text) / 864e5 : parseFloat(text);
};
const unit = (one) => (one.unit && !one.date ? ` ${one.unit}` : "");
const shown = (one, x) => (one.categories?.length || one.date ? cell(one, x) : plain(x)) + unit(one);
const painted = (made, code) => { made.style.setProperty("--k", `var(--c${code % 10})`); return made; };
const label = (code) => make("span", { class: "class" }, painted(make("span", { class: "chip" }), code), named(classes[code]));
const bar = (share) => {
  const strip = make("span", { class: "strip", "aria-hidden": "true" }, make("span"));
  strip.firstChild.style.width = `${100 * min(1, share || 0)}%`;
  return strip;
};

/* --- degrees, for what is drawn and said; answers come from the program alone */

const AND = {
  minimum: min, product: (a, b) => a * b, "bounded difference": (a, b) => max(0, a + b - 1),
  "drastic product": (a, b) => (max(a, b) === 1 ? min(a, b) : 0), "nilpotent minimum": (a, b) => (a + b > 1 ? min(a, b) : 0),
  "einstein product": (a, b) => (a * b) / (2 - (a + b - a * b)), "hamacher product": (a, b) => (a * b) / (a + b - a * b) || 0,
};
const OR = {
  maximum: max, sum: (a, b) => a + b, "algebraic sum": (a, b) => a + b - a * b, "bounded sum": (a, b) => min(1, a + b),
  "drastic sum": (a, b) => (min(a, b) ? 1 : max(a, b)), "nilpotent maximum": (a, b) => (a + b < 1 ? max(a, b) : 1),
  "einstein sum": (a, b) => (a + b) / (1 + a * b), "normalized sum": (a, b) => (a + b) / max(1, a + b),
  "hamacher sum": (a, b) => (a * b === 1 ? 1 : (a + b - 2 * a * b) / (1 - a * b)),
};
const HEDGE = {
  any: () => 1, not: (d) => 1 - d, very: (d) => d * d, somewhat: Math.sqrt, cubed: (d) => d ** 3, "very very": (d) => d ** 4,
  plus: (d) => d ** 1.25, minus: (d) => d ** 0.75, "cube root": Math.cbrt,
  extremely: (d) => (d <= 0.5 ? 2 * d * d : 1 - 2 * (1 - d) ** 2),
  seldom: (d) => (d <= 0.5 ? Math.sqrt(d / 2) : 1 - Math.sqrt((1 - d) / 2)),
};
const hedged = (hedges = [], degree) => hedges.reduceRight((d, hedge) => HEDGE[hedge](d), degree);
const find = (all, name) => all.find((one) => one.name === name);
const degree = ({ points = [] }, x) => { // NaN beyond the points
  const after = points.findIndex(([place]) => place >= x);
  if (after < 0 || x < points[0][0]) return NaN;
  const [a, y] = points[max(after - 1, 0)], [b, z] = points[after];
  return b > a ? y + ((x - a) / (b - a)) * (z - y) : z;
};
const shares = (one, found) => one.parts.map((part) => [part.input, part.weight * (found[part.input] - part.centre)]);
const known = () => { // each variable's value, by its name
  const found = Object.create(null);
  inputs.forEach((one, k) => (found[one.name] = Number.isFinite(values[k]) ? values[k] : one.missing ?? NaN));
  for (const one of variables) {
    if (one.parts.length) found[one.name] = shares(one, found).reduce((sum, [, share]) => sum + share, 0);
    if (one.clips) found[one.name] = min(one.high ?? Infinity, max(one.low ?? -Infinity, found[one.name]));
  }
  return found;
};
const propositions = (when) => (!when ? [] : Array.isArray(when) ? when
  : when.type === "is" ? [when] : (when.parts ?? [when.part]).flatMap(propositions));
const truth = (is, found) => {
  const one = find(variables, is.variable);
  return one ? hedged(is.hedges, max(...(is.terms ?? []).map((term) => degree(find(one.terms, term), found[one.name])))) : NaN;
};
const text = (is) => [is.variable ?? is.output, "is", ...(is.hedges ?? []), (is.terms ?? [is.term]).join(" or ")].join(" ");
const word = (said) => make("span", { class: "word" }, ` ${said} `);
const joined = (said, parts) => parts.flatMap((part, k) => (k ? [word(said), part].flat() : part));
const sentence = (when) => {
  if (when.type === "is") return [named(text(when))];
  if (when.type === "not") return [word("NOT"), "(", ...sentence(when.part), ")"];
  const inner = (part) => (part.parts && part.type !== when.type ? ["(", ...sentence(part), ")"] : sentence(part));
  return joined(when.type === "or" ? "OR" : "AND", (when.parts ?? when).map(inner));
};
const spoken = (rule) => {
  const end = outputs.length ? joined("AND", rule.then.map((one) => [named(text(one))])) : [label(classes.indexOf(rule.then))];
  if ((rule.weight ?? 1) !== 1) end.push(quiet(` (weight ${plain(rule.weight)})`));
  return rule.when ? [word("IF"), ...sentence(rule.when), word("THEN"), ...end] : [word("ALWAYS"), ...end];
};
const order = (strengths) => strengths.map((_, k) => k).sort((a, b) => (strengths[b] || 0) - (strengths[a] || 0) || a - b);

/* --- inputs: a card for each variable */

const MANY = 10; // terms; of more, those of the winning rule are shown
const across = (one, x) => 300 * ((x - one.from) / (one.to - one.from));
const upright = (look, x, y1, y2, ...parts) => (x >= 0 && x <= 300 ? [draw("line", { class: look, x1: x, x2: x, y1, y2 }, ...parts)] : []);
const pin = (one, x, high) => upright("pin", across(one, x), -2, high);
const dots = (one, high, points) => points.map(([x, y]) => `${across(one, x).toFixed(1)},${(high * (1 - min(1, y))).toFixed(1)}`).join(" ");
const picture = (one, high) => draw("svg", { viewBox: `0 -2 300 ${high + 4}`, preserveAspectRatio: "none", "aria-hidden": "true" },
  draw("line", { class: "axis", x1: 0, x2: 300, y1: high, y2: high }),
  ...one.terms.map((term) => draw("polyline", { class: "curve", points: dots(one, high, term.points ?? []) })));
const set = (k, value) => { values[k] = value; later(); };
const cards = variables.map((one) => {
  const k = inputs.indexOf(one), card = { labels: one.terms.map((term) => make("li", {}, named(term.name), " ", make("b"))) };
  if (k < 0) card.box = quiet();
  else if (one.categories.length) card.box = select(one.categories, { id: `v${k}` }, (place) => set(k, place));
  else {
    card.box = make("input", { id: `v${k}`, type: one.date ? "date" : "number", step: one.date || one.is_whole ? 1 : "any" });
    card.box.addEventListener("input", () => { const x = parsed(one, card.box.value); if (Number.isFinite(x)) set(k, x); });
    card.slider = make("input", { type: "range", min: one.from, max: one.to, step: one.step, "aria-label": short(one.name) + unit(one) });
    card.slider.addEventListener("input", () => set(k, Number(card.slider.value)));
  }
  const head = make("div", { class: "head" }, make(k < 0 ? "span" : "label", k < 0 ? {} : { for: `v${k}` }, named(one.name), quiet(unit(one))), card.box);
  if (k >= 0 && one.missing !== undefined) {
    card.gap = make("input", { type: "checkbox" });
    card.gap.addEventListener("change", () => set(k, card.gap.checked ? NaN : one.start));
    head.append(make("label", { class: "missing" }, card.gap, `missing (as ${shown(one, one.missing) || "no category"})`));
  }
  if (!one.categories.length && one.terms.some((term) => term.points)) card.svg = picture(one, 56);
  card.terms = make("ul", { class: "terms" });
  $("inputs").append(make("div", { class: "card input" }, ...[head, card.svg, card.slider, one.terms.length ? card.terms : null].filter(Boolean)));
  return card;
});
const showInputs = (found, winner) => variables.forEach((one, k) => {
  const card = cards[k], x = found[one.name], place = inputs.indexOf(one), isMissing = place >= 0 && !Number.isFinite(values[place]);
  if (place < 0) card.box.textContent = plain(x);
  else {
    if (document.activeElement !== card.box || isMissing) card.box.value = isMissing ? "" : one.categories.length ? values[place] : cell(one, values[place]);
    for (const part of [card.box, card.slider]) if (part) part.disabled = isMissing && Boolean(card.gap);
    if (card.slider) {
      card.slider.value = x;
      card.slider.setAttribute("aria-valuetext", isMissing ? "missing" : shown(one, x));
    }
    if (card.gap) card.gap.checked = isMissing;
  }
  const used = propositions(winner?.when).filter((is) => is.variable === one.name).flatMap((is) => is.terms ?? []);
  const isFew = one.terms.length <= MANY;
  one.terms.forEach((term, j) => {
    const high = degree(term, x), isLit = high > 0.0005 && (isFew || used.includes(term.name));
    card.labels[j].lastChild.textContent = fixed(high);
    for (const part of [card.labels[j], card.svg?.children[j + 1]]) part?.classList.toggle("lit", isLit);
  });
  card.terms.replaceChildren(...card.labels.filter((_, j) => isFew || used.includes(one.terms[j].name)));
  if (!isFew) card.terms.append(make("li", {}, `of ${one.terms.length} terms`));
  card.svg?.querySelector(".pin")?.remove();
  card.svg?.append(...pin(one, x, 56));
});

/* --- the answer */

const REMARKS = ["", "a tie: the first of the strongest rules decides",
  outputs.length ? "no rule concludes an output" : "no rule fires", "a value is missing"];
const showAnswer = (answer, strengths, found) => {
  const code = classes.indexOf(answer.label);
  const lines = outputs.map((one, k) =>
    make("span", { title: String(answer.outputs[k]) }, named(one.name), ` ${plain(answer.outputs[k])}`, make("small", {}, one.unit)));
  const share = code < 0 ? "" : fixed(answer.probabilities?.[code] ?? strengths[answer.rule - 1]);
  if (!outputs.length) lines.push(make("span", {}, code < 0 ? "no class" : label(code), make("small", {}, share)));
  if (REMARKS[answer.status]) lines.push(make("small", {}, REMARKS[answer.status]));
  if ($("answer").textContent !== lines.map((line) => line.textContent).join("")) $("answer").replaceChildren(...lines);
  $("shapes").replaceChildren(...(outputs.length ? outputs.map((one, k) => shape(one, k, answer, found)) : [bars(answer, strengths)]));
};
const bars = (answer, strengths) => {
  const heights = answer.probabilities ?? classes.map((name) => max(0, ...strengths.filter((_, k) => rules[k].then === name)));
  const ranked = heights.length > 12 ? order(heights).slice(0, 12) : heights.map((_, k) => k);
  const list = ranked.map((code) => make("li", {}, label(code), painted(bar(heights[code]), code), make("span", {}, fixed(heights[code]))));
  const of = classes.length > 12 ? `; the 12 highest of ${classes.length}` : "";
  const caption = (answer.probabilities ? "Probability of each class" : "Strongest rule of each class") + of;
  return make("div", {}, make("p", { class: "quiet" }, caption), make("ul", { class: "bars" }, ...list));
};
const shape = (one, place, answer, found) => { // what the rules conclude of an output
  const high = 90, svg = picture(one, high), isWeighted = one.defuzzifier.method.startsWith("weighted");
  const fired = rules.flatMap((rule, k) => {
    let strength = answer.activations[k];
    return strength > 0 ? rule.then.flatMap((end) => {
      strength = hedged(end.hedges, strength);
      return end.output === one.name ? [[find(one.terms, end.term), strength, AND[rule.block.implication ?? "minimum"]]] : [];
    }) : [];
  });
  for (const [term, strength] of fired) {
    const x = across(one, term.weights ? term.weights.reduce((sum, w, k) => sum + w * found[inputs[k].name], term.offset) : term.value ?? NaN);
    svg.append(...upright("stick", x, high, high * (1 - min(1, strength)), draw("title", {}, term.name)));
  }
  if (!isWeighted && fired.length) {
    const join = OR[one.aggregation ?? "maximum"];
    const points = Array.from({ length: 151 }, (_, k) => {
      const x = one.from + ((one.to - one.from) * k) / 150;
      return [x, fired.reduce((sum, [term, strength, cut]) => join(sum, cut(strength, degree(term, x) || 0)), 0)];
    });
    svg.append(draw("polygon", { class: "area", points: `0,${high} ${dots(one, high, points)} 300,${high}` }),
      draw("polyline", { class: "curve lit", points: dots(one, high, points) }));
  }
  svg.append(...pin(one, answer.outputs[place], high));
  const ranked = fired.sort((a, b) => b[1] - a[1]).filter(([term], k, all) => all.findIndex(([other]) => other === term) === k);
  const about = ranked.slice(0, 4).map(([term, strength]) => `${term.name} ${fixed(strength)}`).join(", ") || "no rule concludes it";
  return make("figure", { class: "shape" }, make("figcaption", {}, named(`${one.name}: ${about}`)), svg,
    make("div", { class: "ends" }, make("span", {}, plain(one.from)), make("span", {}, plain(one.to))));
};

/* --- why */

const winnerOf = (answer, strengths) => (answer.rule ? answer.rule - 1 : order(strengths).find((k) => strengths[k] > 0));
const distance = (one, is, x) => { // from the nearest cut of a term of a tree
  const band = is.terms?.length === 1 && !is.hedges ? find(one.terms, is.terms[0]) : {};
  if (one.categories.length || one.date) return "";
  const [cut] = [band.low, band.high].filter((end) => end !== undefined).sort((a, b) => Math.abs(a - x) - Math.abs(b - x));
  return cut === undefined ? "" : `, ${plain(Math.abs(x - cut), 4)} ${x > cut ? "above" : "below"} its cut ${plain(cut)}`;
};
const reasons = (rule, found) => propositions(rule.when).map((is) => {
  const one = find(variables, is.variable);
  if (!one) return { text: text(is), degree: NaN, value: "as far as it is concluded" };
  const sums = shares(one, found).sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]))
    .map(([name, share]) => `${name} ${share < 0 ? "−" : "+"}${plain(Math.abs(share), 4)}`);
  const more = sums.length > 4 ? [`${sums.length - 3} more`] : [];
  return { text: text(is), degree: truth(is, found), value: `value ${shown(one, found[one.name])}` + distance(one, is, found[one.name]),
    sums: sums.slice(0, sums.length > 4 ? 3 : 4).concat(more).join(", ") };
});
const showWhy = (answer, strengths, found) => {
  const first = winnerOf(answer, strengths), ranked = order(strengths).filter((k) => strengths[k] > 0);
  if (first === undefined || answer.status === 3) {
    $("why").replaceChildren(make("p", {}, answer.status === 3 ? "A value is missing, and nothing stands for it." : "No rule fires here."));
    return;
  }
  const { support, then } = rules[first], next = ranked.find((k) => k !== first && (outputs.length || rules[k].then !== then));
  const seen = support === undefined ? "." : `; ${support} training ${support === 1 ? "row reaches" : "rows reach"} it.`;
  const said = outputs.length ? [`Rule ${first + 1} takes part most, ${fixed(strengths[first])}; ${ranked.length} of ${rules.length} fire.`]
    : [`Rule ${first + 1} decides for `, named(then), ` as the strongest, ${fixed(strengths[first])}${seen}`];
  const parts = [make("p", {}, ...said), make("ul", {}, ...reasons(rules[first], found).map((is) => make("li", {}, named(is.text),
    make("span", {}, fixed(is.degree)), make("small", {}, named(is.value), is.sums ? named(` = ${is.sums}`) : ""))))];
  if (next !== undefined) {
    const low = reasons(rules[next], found).reduce((a, b) => (a && !(b.degree < a.degree) ? a : b), null);
    const isAll = low?.degree < 1 && !JSON.stringify(rules[next].when).includes('"type":"or"');
    const whose = outputs.length ? [] : [" for ", named(rules[next].then)];
    parts.push(make("p", { class: "quiet" }, `Runner-up: rule ${next + 1}`, ...whose, `, ${fixed(strengths[next])}`,
      ...(isAll ? [", kept back by ", named(low.text), ` (${fixed(low.degree)}): `, named(low.value)] : []), "."));
  }
  $("why").replaceChildren(...parts);
};
const showCommand = () => {
  const pairs = inputs.map((one, k) => [one.name, cell(one, values[k])]);
  const isPlain = !pairs.flat().some((word) => /[,=]|^[\s{]|\s$/.test(word));
  const row = isPlain ? pairs.map((pair) => pair.join("=")).join(",") : JSON.stringify(Object.fromEntries(pairs));
  const quoted = /^[\w.,=@%+:/-]+$/.test(row) ? row : `'${row.replaceAll("'", "'\\''")}'`;
  $("command").textContent = `${facts.command} --row ${quoted}`;
};

/* --- rules */

const FEW = 15;
let isSorted = rules.length > FEW, isWhole = rules.length <= FEW;
const items = rules.map((rule, k) => {
  const item = make("li", {}, quiet(`${k + 1}`), make("span", {}, ...spoken(rule)), bar(0), make("span"));
  return outputs.length ? item : painted(item, classes.indexOf(rule.then));
});
const showRules = (answer, strengths) => {
  items.forEach((item, k) => {
    item.children[2].replaceWith(bar(strengths[k]));
    item.lastChild.textContent = fixed(strengths[k]);
    item.classList.toggle("off", !(strengths[k] > 0));
    item.classList.toggle("first", answer.rule === k + 1);
  });
  const wanted = (isSorted ? order(strengths) : items.map((_, k) => k)).slice(0, isWhole ? undefined : FEW).map((k) => items[k]);
  const current = [...$("rules").children];
  if (wanted.length !== current.length || wanted.some((item, k) => item !== current[k])) $("rules").replaceChildren(...wanted);
  $("sort").setAttribute("aria-pressed", isSorted);
  $("more").setAttribute("aria-expanded", isWhole);
  $("more").textContent = isWhole ? `Show ${FEW}` : `Show all ${rules.length}`;
};
$("sort").addEventListener("click", () => { isSorted = !isSorted; later(); });
$("more").addEventListener("click", () => { isWhole = !isWhole; later(); });
$("more").hidden = rules.length <= FEW;

/* --- the surface over two inputs */

const axes = [], FINE = 64;
let drawing = 0, drawn = "";
const startSurface = () => {
  $("map").hidden = inputs.length < 2;
  if (inputs.length < 2) return;
  const used = variables.filter((one) => one.terms.length).flatMap((one) => (one.parts.length ? one.parts.map((part) => find(inputs, part.input)) : [one]));
  const firsts = [...new Set([...used, ...inputs])].map((one) => inputs.indexOf(one));
  const choose = (title, names, start) => {
    const box = select(names, {}, () => later());
    box.value = start;
    $("axes").append(make("label", {}, title, box));
    axes.push(box);
  };
  choose("Across", inputs.map((one) => one.name), firsts[0]);
  choose("Up", inputs.map((one) => one.name), firsts[1]);
  if (outputs.length > 1) choose("Output", outputs.map((one) => one.name), 0);
};
const cells = (one) => (one.step === 1 && one.to - one.from < FINE ? one.to - one.from + 1 : FINE); // whole numbers and categories have one each
const middle = (one, k) => (cells(one) < FINE ? one.from + k : one.from + ((one.to - one.from) * (k + 0.5)) / FINE);
const part = (one, x) => (cells(one) < FINE ? (x - one.from + 0.5) / cells(one) : (x - one.from) / (one.to - one.from));
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1).match(/../g).map((two) => parseInt(two, 16));
const showSurface = () => {
  if (!axes.length) return;
  const [a, b, output = 0] = axes.map((box) => Number(box.value));
  const [x, y] = [a, b].map((k) => part(inputs[k], values[k]));
  $("here").hidden = !(x >= 0 && x <= 1 && y >= 0 && y <= 1);
  $("here").style.left = `${100 * x}%`;
  $("here").style.top = `${100 - 100 * y}%`;
  const state = [a, b, output, ...values.filter((_, k) => k !== a && k !== b), ink("--page")].join();
  if (state !== drawn) sweep(a, b, output, ++drawing);
  drawn = state;
};
const sweep = (a, b, output, turn) => { // row after row, so that the page stays quick
  const canvas = $("canvas"), row = values.slice(), wide = cells(inputs[a]), high = cells(inputs[b]);
  const numbers = new Float64Array(wide * high).fill(NaN), codes = new Int32Array(wide * high).fill(-1);
  [canvas.width, canvas.height] = [wide, high];
  canvas.style.imageRendering = min(wide, high) < FINE ? "pixelated" : "auto";
  canvas.setAttribute("aria-label", `${outputs[output]?.name ?? "class"} over ${inputs[a].name} (across) and ${inputs[b].name} (up)`);
  let line = 0;
  const step = () => {
    if (turn !== drawing) return;
    for (const end = performance.now() + 12; line < high && performance.now() < end; line += 1) {
      row[b] = middle(inputs[b], high - 1 - line);
      for (let k = 0, place = line * wide; k < wide; k += 1, place += 1) {
        row[a] = middle(inputs[a], k);
        const answer = model.answer(row);
        codes[place] = outputs.length ? 0 : classes.indexOf(answer.label);
        numbers[place] = outputs.length ? answer.outputs[output] : answer.probabilities?.[codes[place]] ?? answer.strengths[answer.rule - 1];
      }
    }
    colour(canvas, numbers, codes, outputs[output]);
    if (line < high) requestAnimationFrame(step);
  };
  step();
};
const colour = (canvas, numbers, codes, output) => {
  const context = canvas.getContext("2d"), image = context.createImageData(canvas.width, canvas.height);
  const low = numbers.reduce((a, b) => (b < a ? b : a), Infinity), high = numbers.reduce((a, b) => (b > a ? b : a), -Infinity);
  const soft = ink("--soft"), inks = output ? [ink("--link")] : classes.map((_, k) => ink(`--c${k % 10}`));
  numbers.forEach((x, k) => {
    if (codes[k] < 0 || Number.isNaN(x)) return;
    const share = output ? (high > low ? (x - low) / (high - low) : 0.5) : 0.2 + 0.8 * x ** 1.5;
    inks[codes[k]].forEach((full, j) => (image.data[4 * k + j] = soft[j] + (full - soft[j]) * share));
    image.data[4 * k + 3] = 255;
  });
  context.putImageData(image, 0, 0);
  const seen = [...new Set(codes)].filter((code) => code >= 0).sort((x, y) => x - y);
  const ramp = () => [plain(low), make("span", { class: "ramp" }), plain(high), quiet(named(output.name))];
  $("legend").replaceChildren(...(output ? ramp() : seen.slice(0, 30).map(label)));
};
$("plot").addEventListener("click", (event) => {
  const box = $("canvas").getBoundingClientRect();
  [(event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height].forEach((share, j) => {
    const k = Number(axes[j].value), one = inputs[k];
    const x = cells(one) < FINE ? one.from + Math.floor(share * cells(one)) : one.from + share * (one.to - one.from);
    set(k, min(one.to, max(one.from, Number((Math.round(x / one.step) * one.step).toPrecision(12)))));
  });
});

/* --- rows of the table, the address, and the loop */

const startRows = () => {
  const box = make("input", { type: "number", min: 1, max: rows.length, value: 1, "aria-label": "Row of the table" });
  const move = (by) => {
    box.value = min(rows.length, max(1, (parseInt(box.value, 10) || 1) + by));
    rows[box.value - 1].forEach((x, k) => set(k, x ?? NaN));
  };
  box.addEventListener("change", () => move(0));
  const of = rows.length < facts.total ? `of the first ${rows.length} of ${facts.total} rows` : `of ${rows.length} rows`;
  const turn = (sign, by, title) => button(sign, () => move(by), { "aria-label": title });
  if (rows.length) $("rows").append(quiet("Row"), turn("‹", -1, "Row before"), box, turn("›", 1, "Next row"), quiet(of));
  $("rows").append(button("Reset", () => inputs.forEach((one, k) => set(k, one.start))));
};
const readAddress = () => {
  const row = new URLSearchParams(location.hash.slice(1));
  inputs.forEach((one, k) => { if (row.has(one.name)) values[k] = parsed(one, row.get(one.name)); });
};
const writeAddress = () => {
  const row = new URLSearchParams(inputs.map((one, k) => [one.name, cell(one, values[k])]));
  try { history.replaceState(null, "", `#${row}`); } catch { /* a frame without an address */ }
};
const update = () => {
  const answer = model.answer(values), strengths = answer.strengths ?? answer.activations, found = known();
  showInputs(found, rules[winnerOf(answer, strengths)]);
  showAnswer(answer, strengths, found);
  showWhy(answer, strengths, found);
  showRules(answer, strengths);
  showCommand();
  showSurface();
};
let waiting = 0, writing = 0;
const later = () => {
  waiting ||= requestAnimationFrame(() => { waiting = 0; update(); });
  clearTimeout(writing);
  writing = setTimeout(writeAddress, 250);
};
$("copy").addEventListener("click", async () => {
  getSelection().selectAllChildren($("command"));
  try { await navigator.clipboard.writeText($("command").textContent); } catch { document.execCommand("copy"); }
  $("copy").textContent = "Copied";
  setTimeout(() => ($("copy").textContent = "Copy the command"), 1500);
});
addEventListener("hashchange", () => { readAddress(); later(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
const wrong = model.selfTest();
$("warning").hidden = !wrong.length;
$("warning").textContent = `This browser computes other numbers than fuzzytree: ${wrong[0]?.slice(0, 300)}`;
const about = "Its program is that of `fuzzytree export --to javascript`; the self-test passed in this browser.";
$("checked").textContent = wrong.length ? "" : `${about} Fingerprint ${facts.fingerprint.slice(0, 12)}.`;
$("proof").hidden = !inputs.length;
startRows();
startSurface();
readAddress();
update();
