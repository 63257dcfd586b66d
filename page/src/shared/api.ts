/** The server, asked. */

import { fromServer, t, type Words } from "./i18n";
import type { FieldFault } from "../types";

/** Where this page's vehicle is served: nothing for the first, /vehicle/2 for another. */
export const BASE = /^\/vehicle\/\d+/.exec(location.pathname)?.[0] ?? "";

/** This page's own name, kept over a reload: one page commands, others look on. */
export const PAGE = pageName();

/**
 * The name lies in the store only while the page is away: a duplicate of an open tab, or a tab that
 * it opens, gets a copy of the store and must not get its name, with which it would command, too.
 */
function pageName(): string {
  const made = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  try {
    const name = sessionStorage.getItem("page") ?? made;
    sessionStorage.removeItem("page");
    addEventListener("pagehide", () => sessionStorage.setItem("page", name));
    addEventListener("pageshow", () => sessionStorage.removeItem("page")); // came back whole
    return name;
  } catch {
    return made; // a private window: a reload is another page
  }
}

export class ApiError extends Error {
  constructor(
    readonly words: Words,
    readonly status: number,
    readonly faults: FieldFault[] = [],
    readonly body: Record<string, unknown> = {},
  ) {
    super(words);
  }
}

const AGAIN_MS = 2000;

/** Explain to the operator why a request failed. */
export function reasonOf(error: unknown): Words {
  return error instanceof ApiError ? error.words : t("api.server_unreachable");
}

export async function get<T>(path: string): Promise<T> {
  return answer<T>(await fetch(`${BASE}/api${path}`));
}

/** What cannot be had now comes later: the station may be starting or busy. */
export async function getOnceThere<T>(path: string): Promise<T> {
  for (;;) {
    try {
      return await get<T>(path);
    } catch {
      await new Promise((done) => setTimeout(done, AGAIN_MS));
    }
  }
}

export async function send<T>(
  method: "POST" | "PUT" | "DELETE",
  path: string,
  body: unknown,
  headers: Record<string, string> = {},
  base = BASE,
): Promise<T> {
  const response = await fetch(`${base}/api${path}`, {
    method,
    headers: { "Content-Type": "application/json", "X-Page": PAGE, ...headers },
    body: JSON.stringify(body),
  });
  return answer<T>(response);
}

/** Binary columns in the order of their names, all of one length. */
export async function columns(path: string, names: readonly string[], more = ""): Promise<Float64Array[]> {
  const response = await fetch(`${BASE}/api${path}?names=${names.join(",")}${more}`);
  if (!response.ok) throw await refusal(response);
  const cells = new Float64Array(await response.arrayBuffer());
  const count = cells.length / names.length;
  return names.map((_, place) => cells.subarray(place * count, (place + 1) * count));
}

async function answer<T>(response: Response): Promise<T> {
  if (response.ok) return (await response.json()) as T;
  throw await refusal(response);
}

async function refusal(response: Response): Promise<ApiError> {
  const body = (await response.json().catch(() => ({}))) as Record<string, unknown>;
  const text = body.error ?? body.message;
  const words = text === undefined ? t("api.server_answered", { status: response.status }) : fromServer(String(text));
  return new ApiError(words, response.status, (body.faults as FieldFault[] | undefined) ?? [], body);
}

/** Send a file as it is. */
export async function upload<T>(path: string, file: File): Promise<T> {
  const headers = { "Content-Type": "application/octet-stream", "X-Page": PAGE };
  return answer<T>(await fetch(`/api${path}`, { method: "PUT", headers, body: file }));
}
