/**
 * JSON whose whole numbers stay exact: those beyond 2^53 are bigints. `inf` and `nan`, which
 * FlatBuffers' JSON has of its own, are read, too.
 */
export type Json =
  null | boolean | number | bigint | string | readonly Json[] | {readonly [key: string]: Json};

export type JsonObject = {readonly [key: string]: Json};

// A string, which is skipped; a whole number of 16 digits and more; or what JSON has no word for.
const kSpecial = /"(?:[^"\\]|\\.)*"|(?<![\d.])-?\d{16,}(?![\d.eE])|-?\binf\b|\bnan\b/g;
const kMark = '\u0000long:';
const kReals: Readonly<Record<string, number>> = {inf: Infinity, '-inf': -Infinity, nan: NaN};

/** Throws SyntaxError where `text` is not JSON. */
export function parseJson(text: string): Json {
  const marked = text.replace(kSpecial, (found) => {
    if (found.startsWith('"') || Number.isSafeInteger(Number(found))) return found;
    return `"\\u0000long:${found}"`;
  });
  if (marked.length === text.length) return JSON.parse(text) as Json;
  return JSON.parse(marked, (_key, value: Json) => {
    if (typeof value !== 'string' || !value.startsWith(kMark)) return value;
    const digits = value.slice(kMark.length);
    return kReals[digits] ?? BigInt(digits);
  }) as Json;
}

export function writeJson(value: Json): string {
  if (typeof value === 'bigint') return value.toString();
  if (Array.isArray(value)) return `[${value.map(writeJson).join(',')}]`;
  if (value !== null && typeof value === 'object') {
    const fields = Object.entries(value).map(
      ([key, one]) => `${JSON.stringify(key)}:${writeJson(one)}`,
    );
    return `{${fields.join(',')}}`;
  }
  return JSON.stringify(value);
}
