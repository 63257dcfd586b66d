/**
 * Elements without HTML text: what the drone or a file says can never become markup. What people
 * read or hear is `Words`: a text by its id, what the server says, or a name (`i18n.ts`).
 */

import type { Words } from "./i18n";

type Shown = Words | "";
type Child = Node | Shown | number | null | undefined | false;
/** Attributes that people read or hear. */
interface Spoken {
  title?: Shown;
  "aria-label"?: Shown;
  placeholder?: Shown;
  alt?: Shown;
}

export function h<K extends keyof HTMLElementTagNameMap>(
  name: K,
  properties: Spoken & Record<string, unknown> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value as EventListener);
    else if (key === "class") element.className = String(value);
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  append(element, children);
  return element;
}

export function append(parent: Node, children: Child[]): void {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    parent.appendChild(child instanceof Node ? child : document.createTextNode(String(child)));
  }
}

/** Replace what an element holds. */
export function fill(element: Element, ...children: Child[]): void {
  element.replaceChildren();
  append(element, children);
}

/** Set text only where it differs: screen readers and selections stay calm. */
export function say(element: Element, words: Shown): void {
  if (element.textContent !== words) element.textContent = words;
}

/** Set an attribute that people read or hear. */
export function describe(element: Element, name: keyof Spoken, words: Shown): void {
  if (element.getAttribute(name) !== words) element.setAttribute(name, words);
}

export function by(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`no element ${id}`);
  return element;
}

/** What stands in an input or is chosen in a list. */
export function valueOf(id: string): string {
  return (by(id) as HTMLInputElement | HTMLSelectElement).value;
}

/** The number in an input, a decimal comma as a point; NaN for none. */
export function numberOf(id: string): number {
  const text = valueOf(id).replace(",", ".").trim();
  return text === "" ? NaN : Number(text);
}

const SVG = "http://www.w3.org/2000/svg";

export function svg(name: string, attributes: Spoken & Record<string, string | number>, ...children: Node[]): SVGElement {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  for (const child of children) element.appendChild(child);
  return element;
}
