/** The server, asked. */

import type { FieldFault } from "./types";

export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number,
    readonly faults: FieldFault[] = [],
  ) {
    super(message);
  }
}

export async function get<T>(path: string): Promise<T> {
  return answer<T>(await fetch(`/api${path}`));
}

export async function send<T>(method: "POST" | "PUT" | "DELETE", path: string, body: unknown): Promise<T> {
  const response = await fetch(`/api${path}`, {
    method,
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
  return answer<T>(response);
}

/** Binary columns: the buffer and how many columns it holds. */
export async function columns(path: string): Promise<[ArrayBuffer, number]> {
  const response = await fetch(`/api${path}`);
  if (!response.ok) throw new ApiError(await reason(response), response.status);
  const count = (response.headers.get("X-Columns") ?? "").split(",").length;
  return [await response.arrayBuffer(), count];
}

async function answer<T>(response: Response): Promise<T> {
  if (response.ok) return (await response.json()) as T;
  const body = (await response.json().catch(() => ({}))) as Record<string, unknown>;
  const text = String(body.error ?? body.message ?? `the server answered ${response.status}`);
  throw new ApiError(text, response.status, (body.faults as FieldFault[] | undefined) ?? []);
}

async function reason(response: Response): Promise<string> {
  const body = (await response.json().catch(() => ({}))) as Record<string, unknown>;
  return String(body.error ?? `the server answered ${response.status}`);
}
