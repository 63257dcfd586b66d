/**
 * The page's language. Texts are English in the code and in what the server says; the catalogue,
 * `texts.json`, has each in German, with {} for what is put in. What elements show passes through
 * here (`dom.ts`), so that a text cannot forget it. What people or instruments have named is in
 * elements with translate="no".
 */

import german from "./texts.json";

/** Each names itself. */
export const LANGUAGES: [string, string][] = [
  ["en", "English"],
  ["de", "Deutsch"],
];
const CATALOGUES: Record<string, Record<string, string>> = { de: german };
const KEPT_MOST = 5000;
/** The same in all languages. */
const UNITS = /\b(MHz|UTC|min|CSV|GEOJSON|KML|KMZ|GPX|MGRS|DMS|UTM)\b/g;

export const language = chosen();
const catalogue = CATALOGUES[language];
const whole = new Map(Object.entries(catalogue ?? {}).map(([text, words]) => [plain(text), words]));
const patterns = Object.entries(catalogue ?? {})
  .filter(([text]) => text.includes("{}"))
  .sort(([a], [b]) => bare(b).length - bare(a).length)
  .map(([text, words]): [RegExp, string] => [pattern(text), words]);
const kept = new Map<string, string>();
/** Texts with letters for which the catalogue has no words; a test looks at it. */
export const missing = new Set<string>();

function chosen(): string {
  const known = LANGUAGES.map(([name]) => name);
  let wanted = navigator.languages.map((one) => one.slice(0, 2)).find((one) => known.includes(one)) ?? "en";
  try {
    wanted = localStorage.getItem("language") ?? wanted;
  } catch {
    // Private windows keep nothing; the browser's language will do.
  }
  return known.includes(wanted) ? wanted : "en";
}

/** Keep the choice, and show the page in it. */
export function choose(name: string): void {
  try {
    localStorage.setItem("language", name);
  } catch {
    // As above: then it cannot be chosen.
  }
  location.reload();
}

/** A text in the chosen language; as it is where there are no words for it. */
export function told(text: string): string {
  if (!catalogue) return text;
  const known = kept.get(text);
  if (known !== undefined) return known;
  const found = find(text);
  if (found === null && /\p{L}{3}/u.test(text.replace(UNITS, ""))) missing.add(text);
  if (kept.size > KEPT_MOST) kept.clear();
  kept.set(text, found ?? text);
  return found ?? text;
}

function find(text: string): string | null {
  const [, before, middle, after] = /^(\s*)(.*?)(\s*)$/su.exec(text)!;
  const words = findBare(middle!);
  return words === null ? null : before + words + after;
}

function findBare(text: string): string | null {
  const one = whole.get(plain(text));
  if (one !== undefined) return one;
  if (text.includes(" · ")) return text.split(" · ").map(told).join(" · ");
  const fault = faultAndRemedy(text);
  if (fault !== null) return fault;
  for (const [form, words] of patterns) {
    const found = form.exec(plain(text));
    if (found) return filled(words, found.slice(1).map((part) => find(part) ?? part));
  }
  return null;
}

/** Errors say what is wrong, then what to do: each has its own words. */
function faultAndRemedy(text: string): string | null {
  for (let at = text.indexOf(". "); at > 0; at = text.indexOf(". ", at + 1)) {
    const fault = findBare(text.slice(0, at));
    const remedy = fault === null ? null : findBare(text.slice(at + 2));
    if (remedy !== null) return `${fault}. ${remedy}`;
  }
  return null;
}

/** Narrow spaces before units are as good as others. */
function plain(text: string): string {
  return text.replaceAll("\u202f", " ");
}

function bare(text: string): string {
  return text.replaceAll("{}", "");
}

/** What follows another at once is a remark, begun by a comma, or nothing. */
function pattern(text: string): RegExp {
  const escaped = plain(text).replace(/[.*+?^$()|[\]\\]/g, "\\$&");
  return new RegExp(`^${escaped.replaceAll("{}{}{}", "{}<><>").replaceAll("{}{}", "{}<>").replaceAll("<>", "((?:, .*?)?)").replaceAll("{}", "(.*?)")}$`, "su");
}

function filled(words: string, parts: string[]): string {
  let next = 0;
  return words.replace(/\{\}/g, () => parts[next++] ?? "");
}
