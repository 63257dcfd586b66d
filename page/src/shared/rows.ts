/** Small tables of labels and values, in cards. */

import { fill, h } from "./dom";
import { t, type Words } from "./i18n";

type Value = Words | "" | null | undefined | false;
/** A label and its values, one a line; without a value there is no row. */
export type Row = [Words, ...Value[]];

export function rowList(rows: Row[] = []): HTMLElement {
  const list = h("dl", { class: "rows" });
  fillRows(list, rows);
  return list;
}

/** Draw the rows where they have changed. */
export function fillRows(list: HTMLElement, rows: Row[]): void {
  const shown = rows.map(([label, ...values]) => ({ label, values: values.filter(Boolean) as Words[] })).filter((row) => row.values.length);
  const key = JSON.stringify(shown);
  if (list.dataset.shown === key) return;
  list.dataset.shown = key;
  fill(list, ...shown.flatMap(({ label, values }) => [h("dt", {}, label), ...values.map((value) => h("dd", {}, value))]));
}

/** A table of flights or animals, by the titles of its columns. */
export function tableOf(titles: (Words | "")[], rows: HTMLElement[]): HTMLElement {
  const head = titles.map((title) => h("th", { scope: "col" }, title));
  return h("table", { class: "flights" }, h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...rows));
}

/** Rows that help no decision in the field, shown on request. */
export function folded(list: HTMLElement): HTMLElement {
  return h("details", { class: "more" }, h("summary", {}, t("common.details")), list);
}
