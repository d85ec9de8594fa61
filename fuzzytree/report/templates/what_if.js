"use strict";
const $ = (id) => document.getElementById(id);
const facts = JSON.parse($("facts").textContent);
const model = fuzzytree[facts.name];
const { variables, rules, outputs, classes } = facts;
const inputs = variables.filter((one) => one.parts.length === 0);
const values = inputs.map((one) => one.start);

/* --- elements, numbers and words */

const node = (space, tag, look, ...parts) => {
  const made = document.createElementNS(`http://www.w3.org/${space}`, tag);
  for (const [name, value] of Object.entries(look)) made.setAttribute(name, value);
  made.append(...parts);
  return made;
};
const make = (tag, look = {}, ...parts) => node("1999/xhtml", tag, look, ...parts);
const draw = (tag, look, ...parts) => node("2000/svg", tag, look, ...parts);
const short = (text) => (text.length > 200 ? `${text.slice(0, 199)}…` : text);
const named = (text) => make("bdi", {}, short(text));
const fixed = (share) => (Number.isFinite(share) ? share.toFixed(3) : "–");
const plain = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(6))) : "no number");
const colour = (code) => `--k: var(--c${code % 10})`;
const paint = (element, code) => (element.style.cssText = colour(code), element);
const label = (code) => [paint(make("span", { class: "chip" }), code), named(classes[code])];
const bar = () => make("span", { class: "bar", "aria-hidden": "true" }, make("span"));
const fill = (element, share) => element.firstChild.style.setProperty("--share", share || 0);
const day = (value) => new Date(Math.round(value * 864e5)).toISOString().slice(0, 10);
const cell = (one, value) => {
  if (value === null || Number.isNaN(value)) return "";
  if (one.categories.length) return one.categories[value] ?? "";
  return one.isDate ? day(value) : String(value);
};
const shown = (one, value) =>
  (one.categories.length || one.isDate ? cell(one, value) : plain(value)) + (one.unit ? ` ${one.unit}` : "");
const words = (text) =>
  text.split("\u001f").map((part, k) => (k % 2 ? make("span", { class: "word" }, part) : named(part)));

/* --- degrees, for what is drawn and said; the model itself is `model.answer` */

const least = Math.min, most = Math.max;
const AND = {
  minimum: least, product: (a, b) => a * b, "bounded difference": (a, b) => most(0, a + b - 1),
  "drastic product": (a, b) => (most(a, b) === 1 ? least(a, b) : 0),
  "einstein product": (a, b) => (a * b) / (2 - (a + b - a * b)),
  "hamacher product": (a, b) => (a + b === 0 ? 0 : (a * b) / (a + b - a * b)),
  "nilpotent minimum": (a, b) => (a + b > 1 ? least(a, b) : 0),
};
const OR = {
  maximum: most, sum: (a, b) => a + b, "algebraic sum": (a, b) => a + b - a * b,
  "bounded sum": (a, b) => least(1, a + b), "drastic sum": (a, b) => (least(a, b) === 0 ? most(a, b) : 1),
  "einstein sum": (a, b) => (a + b) / (1 + a * b),
  "hamacher sum": (a, b) => (a * b === 1 ? 1 : (a + b - 2 * a * b) / (1 - a * b)),
  "nilpotent maximum": (a, b) => (a + b < 1 ? most(a, b) : 1),
  "normalized sum": (a, b) => (a + b) / most(1, a + b),
};
const HEDGE = {
  any: () => 1, not: (d) => 1 - d, very: (d) => d * d, somewhat: Math.sqrt, cubed: (d) => d ** 3,
  extremely: (d) => (d <= 0.5 ? 2 * d * d : 1 - 2 * (1 - d) ** 2), "very very": (d) => d ** 4,
  seldom: (d) => (d <= 0.5 ? Math.sqrt(d / 2) : 1 - Math.sqrt((1 - d) / 2)),
  plus: (d) => d ** 1.25, minus: (d) => d ** 0.75, "cube root": Math.cbrt,
};
const hedged = (hedges, degree) => hedges.reduceRight((d, hedge) => HEDGE[hedge](d), degree);

/* The degree of a term at a value, between its points; NaN beyond them. */
const degree = (term, value) => {
  if (term.at !== undefined) return Number(value === term.at);
  const points = term.points ?? [];
  const after = points.findIndex(([x]) => x >= value);
  if (after < 0 || value < points[0][0]) return NaN;
  const [[a, y], [b, z]] = [points[most(after - 1, 0)], points[after]];
  return b > a ? y + ((value - a) / (b - a)) * (z - y) : z;
};

/* The value of each variable: what stands for a missing one, and the sums of others. */
const known = () => {
  let place = 0;
  const found = variables.map((one) => {
    if (one.parts.length) return NaN;
    const value = values[place++];
    return Number.isFinite(value) ? value : one.missing ?? NaN;
  });
  variables.forEach((one, k) => {
    for (const [, share] of shares(one, found)) found[k] = (Number.isNaN(found[k]) ? 0 : found[k]) + share;
    if (one.clip) found[k] = least(one.clip[1] ?? Infinity, most(one.clip[0] ?? -Infinity, found[k]));
  });
  return found;
};
const shares = (one, found) => one.parts.map(([part, weight, centre]) => [part, weight * (found[part] - centre)]);
const truth = ([place, terms, hedges], found) =>
  hedged(hedges, most(...terms.map((k) => degree(variables[place].terms[k], found[place]))));

/* --- inputs */

const curves = (one, high) => one.terms.filter((term) => term.points).map((term) => {
  const at = ([x, y]) => `${(((x - one.low) / (one.high - one.low)) * 300).toFixed(1)} ${((1 - y) * high).toFixed(1)}`;
  return draw("path", { class: "curve", d: `M${term.points.map(at).join("L")}` });
});
const picture = (one, high) => draw("svg", { viewBox: `0 -2 300 ${high + 4}`, preserveAspectRatio: "none", "aria-hidden": "true" },
  draw("line", { class: "axis", x1: 0, x2: 300, y1: high, y2: high }), ...curves(one, high));
const pin = (one, value, high) => {
  const x = 300 * least(1, most(0, (value - one.low) / (one.high - one.low)));
  return draw("line", { class: "pin", x1: x, x2: x, y1: -2, y2: high });
};
const set = (k, value) => { values[k] = value; later(); };

const controls = (one, k) => {
  const name = one.name + (one.unit ? ` in ${one.unit}` : "");
  const parts = {};
  if (one.categories.length) {
    parts.box = make("select", { id: `v${k}` }, ...one.categories.map((text, place) => make("option", { value: place }, short(text))));
    parts.box.addEventListener("change", () => set(k, Number(parts.box.value)));
  } else {
    parts.box = make("input", { id: `v${k}`, type: one.isDate ? "date" : "number", step: one.isDate ? 1 : "any" });
    parts.box.addEventListener("input", () => {
      const value = one.isDate ? Date.parse(parts.box.value) / 864e5 : parseFloat(parts.box.value);
      if (Number.isFinite(value)) set(k, value);
    });
    parts.slider = make("input", { type: "range", min: one.low, max: one.high, step: one.step, "aria-label": short(name) });
    parts.slider.addEventListener("input", () => set(k, Number(parts.slider.value)));
  }
  if (one.missing !== null) {
    parts.gap = make("input", { type: "checkbox" });
    parts.gap.addEventListener("change", () => set(k, parts.gap.checked ? NaN : one.start));
  }
  return parts;
};

const MANY = 10; // terms; of more, those of the winning rule are shown
const cards = variables.map((one) => {
  const k = inputs.indexOf(one);
  const parts = k < 0 ? {} : controls(one, k);
  const unit = one.unit ? make("span", { class: "quiet" }, ` ${one.unit}`) : "";
  const title = k < 0 ? make("span", {}, named(one.name)) : make("label", { for: `v${k}` }, named(one.name), unit);
  if (k < 0) parts.sum = make("span", { class: "quiet" });
  const gap = parts.gap ? [make("label", { class: "missing" }, parts.gap, `missing (as ${shown(one, one.missing) || "no category"})`)] : [];
  const head = make("div", { class: "head" }, title, ...gap, parts.box ?? parts.sum);
  parts.terms = make("ul", { class: "terms" });
  parts.labels = one.terms.map((term) => make("li", {}, named(term.name), " ", make("span")));
  if (one.terms.length <= MANY) parts.terms.append(...parts.labels);
  const isDrawn = !one.categories.length && one.terms.some((term) => term.points);
  if (isDrawn) parts.svg = picture(one, 56);
  const pieces = [head, parts.svg, parts.slider, parts.terms].filter(Boolean);
  $("inputs").append(make("div", { class: "card input" }, ...pieces));
  return parts;
});

const showInputs = (found, winner) => variables.forEach((one, k) => {
  const parts = cards[k], value = found[k], place = inputs.indexOf(one);
  if (place >= 0) {
    const isMissing = !Number.isFinite(values[place]);
    const text = one.categories.length ? String(values[place]) : cell(one, values[place]);
    if (document.activeElement !== parts.box || isMissing) parts.box.value = isMissing ? "" : text;
    parts.box.disabled = isMissing;
    if (parts.slider) {
      parts.slider.value = value;
      parts.slider.disabled = isMissing;
      parts.slider.setAttribute("aria-valuetext", isMissing ? "missing" : shown(one, value));
    }
    if (parts.gap) parts.gap.checked = isMissing;
  } else parts.sum.textContent = plain(value);
  const lines = parts.svg ? [...parts.svg.querySelectorAll(".curve")] : [];
  const used = winner?.when.filter(([place]) => place === k).flatMap(([, terms]) => terms) ?? [];
  one.terms.forEach((term, j) => {
    const high = degree(term, value), isLit = high > 0.0005 && (one.terms.length <= MANY || used.includes(j));
    parts.labels[j].lastChild.textContent = fixed(high);
    parts.labels[j].classList.toggle("lit", isLit);
    if (term.points) lines.shift()?.classList.toggle("lit", isLit);
  });
  if (one.terms.length > MANY) parts.terms.replaceChildren(...used.map((j) => parts.labels[j]), make("li", {}, `${one.terms.length} terms`));
  parts.svg?.querySelector(".pin")?.remove();
  if (Number.isFinite(value)) parts.svg?.append(pin(one, value, 56));
});

/* --- the answer */

const REMARKS = ["", "a tie: the first of the strongest rules decides", "no rule fires", "a value is missing"];
const showAnswer = (answer, degrees) => {
  const code = classes.indexOf(answer.label);
  const lines = outputs.length
    ? outputs.map((one, k) => make("span", { title: String(answer.outputs[k]) },
      named(one.name), " ", plain(answer.outputs[k]), make("small", {}, one.unit)))
    : [make("span", {}, ...(code < 0 ? ["no class"] : label(code)), make("small", {},
      answer.probabilities && code >= 0 ? fixed(answer.probabilities[code]) : ""))];
  if (REMARKS[answer.status]) lines.push(make("small", {}, REMARKS[answer.status]));
  const fresh = make("output", {}, ...lines);
  if ($("answer").textContent !== fresh.textContent) $("answer").replaceChildren(...fresh.childNodes);
  $("shapes").replaceChildren(...(outputs.length ? outputs.map((one, k) => shape(one, k, answer)) : [bars(answer, degrees)]));
};

const bars = (answer, degrees) => {
  const heights = answer.probabilities ?? classes.map((_, code) => most(0, ...degrees.filter((_, k) => rules[k].class === code)));
  const ranked = classes.map((_, code) => code);
  if (ranked.length > 12) ranked.sort((a, b) => heights[b] - heights[a]);
  const list = ranked.slice(0, 12).map((code) => {
    const strip = paint(bar(), code);
    fill(strip, heights[code]);
    return make("li", {}, make("span", {}, ...label(code)), strip, make("span", {}, fixed(heights[code])));
  });
  const caption = answer.probabilities ? "Probability of each class" : "Strongest rule of each class";
  const more = classes.length > 12 ? `; the 12 highest of ${classes.length}` : "";
  return make("div", {}, make("p", { class: "quiet" }, caption + more), make("ul", { class: "bars" }, ...list));
};

/* What the rules conclude of an output: its aggregated curve, or weighted numbers. */
const shape = (one, place, answer) => {
  const high = 90, svg = picture(one, high);
  const fired = rules.flatMap((rule, k) => {
    let strength = answer.activations[k];
    return !(strength > 0) ? [] : rule.then.flatMap(([output, term, hedges]) => {
      strength = hedged(hedges, strength);
      return output === place ? [[one.terms[term], strength, AND[rule.implication]]] : [];
    });
  });
  const across = (x) => ((x - one.low) / (one.high - one.low)) * 300;
  const row = known().filter((_, k) => variables[k].parts.length === 0);
  const number = (term) => term.weights ? term.weights.reduce((sum, w, k) => sum + w * row[k], 0) + term.offset : term.at;
  for (const [term, strength] of fired) {
    const x = across(number(term));
    if (x >= 0 && x <= 300) svg.append(draw("line", { class: "stick", x1: x, x2: x, y1: high, y2: high * (1 - least(1, strength)) }, draw("title", {}, term.name)));
  }
  if (!one.isWeighted && fired.some(([term]) => term.points)) {
    const join = OR[one.aggregation], dots = [];
    for (let k = 0; k <= 150; k += 1) {
      const x = one.low + ((one.high - one.low) * k) / 150;
      const y = fired.reduce((sum, [term, strength, cut]) => join(sum, cut(strength, degree(term, x) || 0)), 0);
      dots.push(`${2 * k} ${(high * (1 - least(1, y))).toFixed(1)}`);
    }
    svg.append(draw("path", { class: "area", d: `M0 ${high}L${dots.join("L")}L300 ${high}z` }));
    svg.append(draw("path", { class: "curve lit", d: `M${dots.join("L")}` }));
  }
  const value = answer.outputs[place];
  if (Number.isFinite(value)) svg.append(pin(one, value, high));
  const about = `${one.name}: ${fired.length ? one.isWeighted ? "what the rules conclude" : "aggregated conclusions" : "no conclusion"}`;
  return make("figure", { class: "shape" }, make("figcaption", {}, named(about)), svg,
    make("div", { class: "ends" }, make("span", {}, plain(one.low)), make("span", {}, plain(one.high))));
};

/* --- why */

const reasons = (rule, found) => rule.when.map((one) => {
  const [place, terms, hedges] = one, variable = variables[place], value = found[place];
  const text = [variable.name, "is", ...hedges, terms.map((k) => variable.terms[k].name).join(" or ")].join(" ");
  const parts = shares(variable, found).sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]));
  const sums = parts.slice(0, 3).map(([part, share]) => `${variables[part].name} ${share < 0 ? "−" : "+"}${plain(Math.abs(share))}`);
  if (parts.length > 3) sums.push(`${parts.length - 3} more`);
  return { text, degree: truth(one, found), value: shown(variable, value), sums: sums.join(", ") };
});
const listed = (rule, found) => make("ul", {}, ...reasons(rule, found).map((one) => make("li", {}, named(one.text),
  make("span", { class: "number" }, fixed(one.degree)), make("small", {}, `value ${one.value}${one.sums ? `: ${one.sums}` : ""}`))));
const order = (degrees) => degrees.map((_, k) => k).sort((a, b) => (degrees[b] || 0) - (degrees[a] || 0) || a - b);

const winnerOf = (answer, degrees) => answer.rule ? answer.rule - 1 : order(degrees).find((k) => degrees[k] > 0);

const showWhy = (answer, degrees, found) => {
  const ranked = order(degrees).filter((k) => degrees[k] > 0), first = winnerOf(answer, degrees);
  if (first === undefined || answer.status === 3) {
    $("why").replaceChildren(make("p", {}, answer.status === 3 ? "A value is missing, and nothing stands for it." : "No rule fires here."));
    return;
  }
  const next = ranked.find((k) => k !== first && (outputs.length || rules[k].class !== rules[first].class));
  const said = outputs.length
    ? [`Rule ${first + 1} takes part most, `, fixed(degrees[first]), `; ${ranked.length} of ${rules.length} rules fire.`]
    : [`Rule ${first + 1} decides for `, named(classes[rules[first].class]), `: it is the strongest, ${fixed(degrees[first])}.`];
  const parts = [make("p", {}, ...said), listed(rules[first], found)];
  if (next !== undefined) {
    const low = rules[next].isAny ? null : reasons(rules[next], found).reduce((a, b) => (a && !(b.degree < a.degree) ? a : b), null);
    const whose = outputs.length ? "" : ` for ${short(classes[rules[next].class])}`;
    const back = low ? `; what keeps it back: ${low.text} (value ${low.value}, degree ${fixed(low.degree)})` : "";
    parts.push(make("p", { class: "quiet" }, named(`Runner-up: rule ${next + 1}${whose}, ${fixed(degrees[next])}${back}.`)));
  }
  $("why").replaceChildren(...parts);
};

const quoted = (text) => (/^[\w.,=@%+:/-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
const showCommand = () => {
  const row = inputs.map((one, k) => `${one.name}=${cell(one, values[k])}`).join(",");
  $("command").textContent = `${facts.command} --row ${quoted(row)}`;
};

/* --- rules */

const FEW = 15;
let isSorted = rules.length > FEW, isWhole = rules.length <= FEW;
const items = rules.map((rule, k) => {
  const end = rule.class === undefined ? words(rule.text) : [...words(rule.text)];
  if (rule.class !== undefined) end.splice(-1, 1, " ", ...label(rule.class));
  const item = make("li", {}, make("span", { class: "quiet" }, `${k + 1}`), make("span", {}, ...end), bar(), make("span"));
  return rule.class === undefined ? item : (paint(item, rule.class), item);
});
const showRules = (answer, degrees) => {
  items.forEach((item, k) => {
    fill(item.children[2], least(1, degrees[k]));
    item.lastChild.textContent = fixed(degrees[k]);
    item.classList.toggle("off", !(degrees[k] > 0));
    item.classList.toggle("first", answer.rule === k + 1);
  });
  const ranked = isSorted ? order(degrees) : items.map((_, k) => k);
  const wanted = ranked.slice(0, isWhole ? undefined : FEW).map((k) => items[k]);
  if (wanted.some((item, k) => $("rules").children[k] !== item) || $("rules").children.length !== wanted.length) $("rules").replaceChildren(...wanted);
  $("sort").setAttribute("aria-pressed", isSorted);
  $("sort").textContent = isSorted ? "In their order" : "Strongest first";
  $("more").hidden = rules.length <= FEW;
  $("more").setAttribute("aria-expanded", isWhole);
  $("more").textContent = isWhole ? `Show ${FEW}` : `Show all ${rules.length}`;
};
$("sort").addEventListener("click", () => { isSorted = !isSorted; later(); });
$("more").addEventListener("click", () => { isWhole = !isWhole; later(); });

/* --- the surface over two inputs */

const choice = (title, names, start, change) => {
  const box = make("select", {}, ...names.map((name, k) => make("option", { value: k }, short(name))));
  box.value = start;
  box.addEventListener("change", change);
  $("axes").append(make("label", {}, title, box));
  return box;
};
let drawing = 0, drawn = "";
const axes = [];
const startSurface = () => {
  $("map").hidden = inputs.length < 2;
  if (inputs.length < 2) return;
  const names = inputs.map((one) => one.name);
  const used = [...new Set(variables.filter((one) => one.terms.length).flatMap((one) =>
    one.parts.length ? one.parts.map(([part]) => variables[part]) : [one]))].map((one) => inputs.indexOf(one));
  const firsts = [...used, 0, 1].filter((k, place, all) => all.indexOf(k) === place);
  axes.push(choice("Across", names, firsts[0], () => later()), choice("Up", names, firsts[1], () => later()));
  if (outputs.length > 1) axes.push(choice("Output", outputs.map((one) => one.name), 0, () => later()));
};
const cells = (one) => one.categories.length || (one.step === 1 && one.high - one.low < 64 ? one.high - one.low + 1 : 64);
const middle = (one, k, count) => one.categories.length || count < 64 ? one.low + k : one.low + ((one.high - one.low) * (k + 0.5)) / count;
const channels = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1).match(/../g).map((two) => parseInt(two, 16));

const showSurface = () => {
  if (!axes.length) return;
  const [a, b, c] = axes.map((box) => Number(box.value));
  const [one, two] = [inputs[a], inputs[b]], counts = [cells(one), cells(two)];
  const part = (k, count, value) => count < 64 ? (value - k.low + 0.5) / count : (value - k.low) / (k.high - k.low);
  const [x, y] = [part(one, counts[0], values[a]), part(two, counts[1], values[b])];
  $("here").hidden = !(x >= 0 && x <= 1 && y >= 0 && y <= 1);
  $("here").style.left = `${100 * x}%`;
  $("here").style.top = `${100 * (1 - y)}%`;
  const others = values.map((value, k) => (k === a || k === b ? "" : value)).join();
  const isDark = matchMedia("(prefers-color-scheme: dark)").matches;
  const state = [a, b, c, others, isDark].join("|");
  if (state === drawn) return;
  drawn = state;
  sweep(a, b, c ?? 0, counts, ++drawing);
};

const sweep = (a, b, output, [wide, high], turn) => {
  const canvas = $("canvas"), row = values.slice();
  const numbers = new Float64Array(wide * high).fill(NaN), codes = new Int32Array(wide * high).fill(-1);
  [canvas.width, canvas.height] = [wide, high];
  canvas.style.imageRendering = least(wide, high) < 64 ? "pixelated" : "auto";
  canvas.setAttribute("aria-label", `${outputs.length ? outputs[output].name : "class"} over ${inputs[a].name} (across) and ${inputs[b].name} (up)`);
  let line = 0;
  const step = () => {
    if (turn !== drawing) return;
    const end = performance.now() + 14;
    while (line < high && performance.now() < end) {
      row[b] = middle(inputs[b], high - 1 - line, high);
      for (let k = 0; k < wide; k += 1) {
        row[a] = middle(inputs[a], k, wide);
        const answer = model.answer(row), place = line * wide + k;
        codes[place] = outputs.length ? 0 : classes.indexOf(answer.label);
        numbers[place] = outputs.length ? answer.outputs[output]
          : answer.probabilities?.[codes[place]] ?? (answer.rule ? answer.strengths[answer.rule - 1] : NaN);
      }
      line += 1;
    }
    colourSurface(canvas, numbers, codes, output);
    if (line < high) requestAnimationFrame(step);
  };
  step();
};

const colourSurface = (canvas, numbers, codes, output) => {
  const context = canvas.getContext("2d"), image = context.createImageData(canvas.width, canvas.height);
  const finite = numbers.filter(Number.isFinite);
  const [low, high] = finite.length ? [finite.reduce((x, y) => least(x, y)), finite.reduce((x, y) => most(x, y))] : [0, 1];
  const soft = channels("--soft"), inks = outputs.length ? [channels("--link")] : classes.map((_, k) => channels(`--c${k % 10}`));
  numbers.forEach((value, k) => {
    if (codes[k] < 0 || Number.isNaN(value)) return;
    const share = outputs.length ? (high > low ? (value - low) / (high - low) : 0.5) : 0.2 + 0.8 * most(0, value) ** 1.5;
    inks[codes[k]].forEach((ink, j) => (image.data[4 * k + j] = soft[j] + (ink - soft[j]) * share));
    image.data[4 * k + 3] = 255;
  });
  context.putImageData(image, 0, 0);
  const seen = [...new Set(codes)].filter((code) => code >= 0).sort((x, y) => x - y);
  $("legend").replaceChildren(...(outputs.length
    ? [make("span", {}, plain(low)), make("span", { class: "ramp" }), make("span", {}, plain(high)), make("span", { class: "quiet" }, named(outputs[output].name))]
    : seen.slice(0, 30).map((code) => make("span", {}, ...label(code)))));
};
$("plot").addEventListener("click", (event) => {
  const box = $("canvas").getBoundingClientRect();
  const shares = [(event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height];
  shares.forEach((share, j) => {
    const k = Number(axes[j].value), one = inputs[k], count = cells(one);
    const raw = count < 64 ? one.low + Math.floor(share * count) : one.low + share * (one.high - one.low);
    values[k] = least(one.high, most(one.low, Number((Math.round(raw / one.step) * one.step).toPrecision(12))));
  });
  later();
});

/* --- rows of the table, the address, and the loop */

const showRow = (k) => { facts.rows[k].forEach((value, j) => (values[j] = value ?? NaN)); later(); };
const startRows = () => {
  const count = facts.rows.length, buttons = $("rows");
  const reset = make("button", { type: "button" }, "Reset");
  reset.addEventListener("click", () => { inputs.forEach((one, k) => (values[k] = one.start)); later(); });
  if (count) {
    const box = make("input", { type: "number", min: 1, max: count, value: 1, "aria-label": "Row of the table" });
    const move = (by) => { box.value = least(count, most(1, (parseInt(box.value, 10) || 1) + by)); showRow(box.value - 1); };
    const turn = (text, by, title) => {
      const button = make("button", { type: "button", "aria-label": title }, text);
      button.addEventListener("click", () => move(by));
      return button;
    };
    box.addEventListener("change", () => move(0));
    const of = count < facts.total ? `of the first ${count} of ${facts.total} rows` : `of ${count} rows`;
    buttons.append(make("span", { class: "quiet" }, "Row"), turn("‹", -1, "Row before"), box, turn("›", 1, "Next row"), make("span", { class: "quiet" }, of));
  }
  buttons.append(reset);
};

const readAddress = () => {
  const row = new URLSearchParams(location.hash.slice(1));
  inputs.forEach((one, k) => {
    const text = row.get(one.name);
    if (text === null) return;
    const place = one.categories.indexOf(text);
    const number = one.isDate ? Date.parse(text) / 864e5 : text.trim() ? Number(text) : NaN;
    values[k] = one.categories.length ? (place < 0 ? NaN : place) : Number.isFinite(number) ? number : NaN;
  });
};
const writeAddress = () => {
  const row = new URLSearchParams(inputs.map((one, k) => [one.name, cell(one, values[k])]));
  try { history.replaceState(null, "", `#${row}`); } catch { /* a frame without an address */ }
};

const update = () => {
  const answer = model.answer(values), degrees = answer.strengths ?? answer.activations, found = known();
  showInputs(found, rules[winnerOf(answer, degrees)]);
  showAnswer(answer, degrees);
  showWhy(answer, degrees, found);
  showRules(answer, degrees);
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
$("warning").textContent = wrong.length ? `This browser computes other numbers than fuzzytree: ${wrong[0].slice(0, 300)}` : "";
$("checked").textContent = wrong.length ? "" : `The program in this page is that of \`fuzzytree export --to javascript\`; its self-test passed here. Fingerprint ${facts.fingerprint.slice(0, 12)}.`;
startRows();
startSurface();
readAddress();
update();
