import {readFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';

/** Messages that `rtpm record` wrote, with what `rtpm echo --json` printed of the same events. */
export interface Recorded {
  readonly topic: string;
  readonly schemaName: string;
  readonly payload: Uint8Array;
  readonly expected: unknown;
}

interface File {
  readonly schemas: Readonly<Record<string, string>>;
  readonly messages: readonly {
    readonly topic: string;
    readonly schemaName: string;
    readonly payload: string;
    readonly expected: unknown;
  }[];
}

export function fixture(name: string): string {
  return readFileSync(fileURLToPath(new URL(`fixtures/${name}`, import.meta.url)), 'utf8');
}

const file = JSON.parse(fixture('recorded.json')) as File;

export function schemaText(name: string): string {
  return file.schemas[name] ?? '';
}

export function schemaBytes(name: string): Uint8Array {
  return new Uint8Array(Buffer.from(schemaText(name), 'base64'));
}

export const recorded: readonly Recorded[] = file.messages.map((one) => ({
  ...one,
  payload: new Uint8Array(Buffer.from(one.payload, 'base64')),
}));
