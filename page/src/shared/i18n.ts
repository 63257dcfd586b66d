/**
 * The page's language. Each text of the page has an id, and each language is a file in `texts/`:
 * id → text with {named} gaps. Elements take `Words` only (`dom.ts`), so that a text without an
 * id, or one built from pieces, does not compile. The server speaks English: what it says is
 * found by its form in `server_texts.json` (id → English, {} for what is put in), and shown by id.
 */

import { recall, remember } from "./remembered";
import english from "../texts/en.json";

export type TextId = keyof typeof english;
declare const chosenLanguage: unique symbol;
/** What can be shown: text in the chosen language, a name, or a number. */
export type Words = string & { readonly [chosenLanguage]: true };
export type Gaps = Record<string, Words | number>;
type Texts = Record<string, string>;

const FILES = import.meta.glob<Texts>(["../texts/*.json", "!../texts/en.json"], { import: "default" });
const FILE_OF = new Map(Object.entries(FILES).map(([path, load]) => [path.slice("../texts/".length, -".json".length), load]));
/** Code and own name of each. */
export const LANGUAGES: [string, Words][] = ["en", ...FILE_OF.keys()].map((code) => [code, verbatim(new Intl.DisplayNames(code, { type: "language" }).of(code)!)]);
const KEPT_MOST = 5000;
/** Two words in a row: a sentence, not a number and hardly a name. */
const SAID = /\p{L}{2} \p{Ll}{2}/u;
/** What no name has in it, whoever gave it; a path may. */
const CLAUSE = /^(?![/']|[A-Z]:\\)(?:.*\s)?(?:the|this|that|there|is|are|be|has|have|cannot|of|from|and|or|it|its|each|than|with)(?:\s|$)/su;
const SENTENCE_END = /\p{L}{3}[.!?] \p{Lu}/u;
/** The same in all languages. */
const UNITS = /\b(MHz|UTC|min|CSV|GEOJSON|KML|KMZ|GPX|MGRS|DMS|UTM)\b/g;

interface Found {
  words: string;
  /** What of the text has no words, and is in it as it was. */
  left: string[];
}

interface Pattern {
  form: RegExp;
  words: string;
  /** Of each gap, whether it quotes: what follows a colon or a bracket may be in any language. */
  quotes: boolean[];
}

export const language = chosen();
const [texts, serverTexts] = await load(language);
const known = Object.entries(serverTexts).flatMap(([id, text]) => (texts[id] === undefined ? [] : [[text, texts[id]] as const]));
const whole = new Map(known.map(([text, words]) => [plain(text), words]));
const patterns = known
  .filter(([text]) => text.includes("{}"))
  .sort(([a], [b]) => bare(b).length - bare(a).length)
  .map(([text, words]): Pattern => ({ form: pattern(text), words, quotes: quotes(text) }));
const kept = new Map<string, string>();
/** What the server said that stayed as it was for want of words; a test looks at it. */
export const missing = new Set<string>();

function chosen(): string {
  const codes = LANGUAGES.map(([code]) => code);
  const wanted = recall("language") ?? navigator.languages.map((one) => one.slice(0, 2)).find((one) => codes.includes(one)) ?? "en";
  return codes.includes(wanted) ? wanted : "en";
}

/** Texts of a language, and the English that the server speaks; English needs neither. */
async function load(code: string): Promise<[Texts, Texts]> {
  const file = FILE_OF.get(code);
  try {
    if (file) return await Promise.all([file(), import("../server_texts.json").then((found): Texts => found.default)]);
  } catch {
    // The server went away: a page in English is better than none.
  }
  return [english, {}];
}

/** Keep the choice, and show the page in it. */
export function choose(name: string): void {
  remember("language", name);
  location.reload();
}

/** The page's text with this id, in the chosen language, its gaps filled. */
export function t(id: TextId, gaps: Gaps = {}): Words {
  return filled(texts[id] ?? english[id], gaps);
}

/** A name, a number or a sign: the same in all languages. */
export function verbatim(text: string | number): Words {
  return String(text) as Words;
}

/** Facts in a row. */
export function listed(...facts: (Words | "" | null | false | undefined)[]): Words {
  return facts.filter(Boolean).join(" · ") as Words;
}

/** What the server says, in the chosen language; as it is where there are no words for it. */
export function fromServer(text: string): Words {
  if (!known.length) return verbatim(text);
  const before = kept.get(text);
  if (before !== undefined) return verbatim(before);
  const found = find(text) ?? { words: text, left: remainder(text) };
  for (const rest of found.left) missing.add(rest);
  if (kept.size > KEPT_MOST) kept.clear();
  kept.set(text, found.words);
  return verbatim(found.words);
}

function find(text: string): Found | null {
  const [, before, middle, after] = /^(\s*)(.*?)(\s*)$/su.exec(text)!;
  const found = findBare(middle!);
  return found === null ? null : { words: before + found.words + after, left: found.left };
}

/** The words for a text that leave the least of it as it is. */
function findBare(text: string): Found | null {
  const one = whole.get(plain(text));
  if (one !== undefined) return { words: one, left: [] };
  if (!/\p{L}/u.test(text)) return null;
  if (text.includes(" · ")) return joined(text.split(" · "), " · ");
  let best: Found | null = null;
  for (const found of ways(text)) {
    if (!found.left.length) return found;
    if (best === null || found.left.join("").length < best.left.join("").length) best = found;
  }
  return best;
}

/** Errors say what is wrong, then what to do: each sentence has words of its own. */
function* ways(text: string): Generator<Found> {
  for (let at = text.indexOf(". "); at > 0; at = text.indexOf(". ", at + 1)) {
    const halves = [text.slice(0, at), text.slice(at + 2)];
    if (halves.some((half) => findBare(half) !== null)) yield joined(halves, ". ");
  }
  for (const one of patterns) {
    const parts = one.form.exec(plain(text))?.slice(1);
    const found = parts && gapsFilled(one, parts);
    if (found) yield found;
  }
}

function joined(parts: string[], between: string): Found {
  const found = parts.map((part) => find(part) ?? { words: part, left: remainder(part) });
  return { words: found.map((one) => one.words).join(between), left: found.flatMap((one) => one.left) };
}

/**
 * A gap is for a name, a number, or what has words itself. Anything said stands only where it is
 * quoted, and nowhere what goes beyond a sentence: such a text is another than the pattern's.
 */
function gapsFilled(one: Pattern, parts: string[]): Found | null {
  const found = parts.map((part) => find(part) ?? { words: part, left: SAID.test(part) || SENTENCE_END.test(part) ? [part] : [] });
  const strange = found.some(({ left }, place) => left.some((rest) => SENTENCE_END.test(rest) || (!one.quotes[place] && CLAUSE.test(rest))));
  if (strange) return null;
  const gaps = Object.fromEntries(found.map(({ words }, place) => [String(place + 1), verbatim(words)]));
  return { words: filled(one.words, gaps), left: found.flatMap(({ left }) => left) };
}

function remainder(text: string): string[] {
  return /\p{L}{3}/u.test(text.replace(UNITS, "")) ? [text] : [];
}

/** Narrow spaces before units are as good as others. */
function plain(text: string): string {
  return text.replaceAll("\u202f", " ");
}

function bare(text: string): string {
  return text.replaceAll("{}", "");
}

function quotes(text: string): boolean[] {
  return text.split("{}").slice(0, -1).map((before) => /[:(] ?$/.test(before));
}

/** What follows another at once is a remark, begun by a comma, or nothing. */
function pattern(text: string): RegExp {
  const escaped = plain(text).replace(/[.*+?^$()|[\]\\]/g, "\\$&");
  return new RegExp(`^${escaped.replaceAll("{}{}{}", "{}<><>").replaceAll("{}{}", "{}<>").replaceAll("<>", "((?:, .*?)?)").replaceAll("{}", "(.*?)")}$`, "su");
}

function filled(words: string, gaps: Gaps): Words {
  return verbatim(words.replace(/\{(\w+)\}/g, (gap, name: string) => String(gaps[name] ?? gap)));
}
