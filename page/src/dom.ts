/**
 * Elements without HTML text: what the drone or a file says can never become markup. Texts are
 * shown in the chosen language, but in elements with translate="no".
 */

import { translated } from "./i18n";

type Child = Node | string | number | null | undefined | false;
type Properties = Record<string, unknown>;

export function h<K extends keyof HTMLElementTagNameMap>(
  name: K,
  properties: Properties = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value as EventListener);
    else if (key === "class") element.className = String(value);
    else describe(element, key, value === true ? "" : String(value));
  }
  append(element, children);
  return element;
}

export function append(parent: Node, children: Child[]): void {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    const text = typeof child === "string" ? inLanguage(parent, child) : String(child);
    parent.appendChild(child instanceof Node ? child : document.createTextNode(text));
  }
}

/** Replace what an element holds. */
export function fill(element: Element, ...children: Child[]): void {
  element.replaceChildren();
  append(element, children);
}

/** Set text only where it differs: screen readers and selections stay calm. */
export function say(element: Element, text: string): void {
  const words = inLanguage(element, text);
  if (element.textContent !== words) element.textContent = words;
}

const SPOKEN = ["title", "aria-label", "placeholder"];

/** Set an attribute; those that people read or hear are in their language. */
export function describe(element: Element, name: string, text: string): void {
  const words = SPOKEN.includes(name) ? inLanguage(element, text) : text;
  if (element.getAttribute(name) !== words) element.setAttribute(name, words);
}

function inLanguage(place: Node, text: string): string {
  return place instanceof Element && place.getAttribute("translate") === "no" ? text : translated(text);
}

export function by(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`no element ${id}`);
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

export function svg(name: string, attributes: Record<string, string | number>, ...children: Node[]): SVGElement {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) describe(element, key, String(value));
  for (const child of children) element.appendChild(child);
  return element;
}
