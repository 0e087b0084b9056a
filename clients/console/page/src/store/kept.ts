import {parseJson, type Json} from '../protocol/json';

/** Choices of this browser. Where it keeps none, or forbids to, they last as long as the page. */

export function recall(key: string): string | null {
  try {
    return globalThis.localStorage?.getItem(key) ?? null;
  } catch {
    return null;
  }
}

/** A kept JSON value; null: nothing, or nothing that can be read. */
export function recallJson(key: string): Json {
  try {
    return parseJson(recall(key) ?? 'null');
  } catch {
    return null;
  }
}

export function remember(key: string, value: string): void {
  try {
    globalThis.localStorage?.setItem(key, value);
  } catch {
    // The choice holds until the page is closed.
  }
}
