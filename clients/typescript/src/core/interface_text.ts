import { printable } from "./bytes.js";

// Compares two versions of an interface by their texts (spec/hprotocol.md, 12.2).

interface MethodText {
  readonly id: string;
  readonly name: string;
  readonly isIdempotent: boolean;
  readonly manner: string; // "oneway sent", "stream" or empty
  readonly request: string; // "struct lab.ForceMessage"
  readonly reply: string;
}

interface TypeText {
  readonly head: string; // "struct lab.Force size 16 align 8"
  readonly kind: string;
  readonly members: readonly string[];
}

interface InterfaceText {
  readonly name: string;
  readonly methods: readonly MethodText[];
  readonly types: ReadonlyMap<string, TypeText>;
}

interface FieldText {
  readonly id: string;
  readonly name: string;
  readonly type: string;
  readonly typeName: string;
  readonly isRequired: boolean;
  readonly isOptional: boolean;
  readonly isDeprecated: boolean;
  readonly defaultValue: string;
  readonly isKey: boolean;
  readonly encodings: string;
  readonly unit: string;
  readonly frame: string;
}

interface ValueText {
  readonly name: string;
  readonly number: string;
  readonly type: string;
}

/** The texts before and behind the first `mark`; all and nothing if there is none. */
function split(text: string, mark: string): [string, string] {
  const at = text.indexOf(mark);
  return at < 0 ? [text, ""] : [text.slice(0, at), text.slice(at + mark.length)];
}

function readMethod(line: string, request: string, reply: string): MethodText | undefined {
  const [id, behindId] = split(line, " ");
  const [name, words] = split(behindId, " ");
  const isIdempotent = words === "idempotent" || words.startsWith("idempotent ");
  const manner = isIdempotent ? words.slice("idempotent ".length) : words;
  if (name === "" || !request.startsWith("request ") || !reply.startsWith("reply ")) {
    return undefined;
  }
  return { id, name, isIdempotent, manner, request: request.slice(8), reply: reply.slice(6) };
}

/** undefined if the text cannot be read (hp-6.3-2). */
function readInterface(text: string): InterfaceText | undefined {
  const lines = text.split("\n");
  if (lines.at(-1) === "") lines.pop();
  const first = lines[0];
  if (first === undefined || !first.startsWith("service ")) return undefined;
  const methods: MethodText[] = [];
  const types = new Map<string, TypeText>();
  for (let i = 1; i < lines.length; i += 1) {
    const line = lines[i]!;
    if (line.startsWith("method ")) {
      const method = readMethod(line.slice(7), lines[i + 1] ?? "", lines[i + 2] ?? "");
      if (method === undefined) return undefined;
      methods.push(method);
      i += 2;
      continue;
    }
    const end = lines.indexOf("}", i);
    if (!line.endsWith(" {") || end < 0) return undefined;
    const head = line.slice(0, -2);
    const [kind, behind] = split(head, " ");
    const [name] = split(behind, " ");
    const members = lines.slice(i + 1, end);
    if (types.has(name) || !members.every((member) => member.startsWith("  "))) return undefined;
    types.set(name, { head, kind, members: members.map((member) => member.slice(2)) });
    i = end;
  }
  return { name: first.slice("service ".length), methods, types };
}

/** Parts ` NAME "VALUE"` from the end of the text. */
function splitQuoted(text: string, name: string): [string, string] {
  const at = text.indexOf(name);
  if (at < 0 || text.length <= at + name.length || !text.endsWith('"')) return [text, ""];
  return [text.slice(0, at), text.slice(at + name.length, -1)];
}

const ruleWords = new Set(["required", "optional", "deprecated", "key", "="]);

function readField(line: string): FieldText | undefined {
  const [id, behindId] = split(line, " ");
  const [name, behindName] = split(behindId, ": ");
  if (name === "" || behindName === "") return undefined;
  // From the end, because units and frames may contain spaces.
  const [withoutFrame, frame] = splitQuoted(behindName, ' frame "');
  const [withoutUnit, unit] = splitQuoted(withoutFrame, ' in "');
  const words = withoutUnit.split(" ");
  const type = words.shift() ?? "";
  const isRule = (word: string): boolean => ruleWords.has(word) || word.includes(":");
  const typeName = words[0] !== undefined && !isRule(words[0]) ? (words.shift() ?? "") : "";
  const rules = new Set<string>();
  let defaultValue = "";
  let encodings = "";
  while (words.length > 0 && encodings === "") {
    const word = words.shift()!;
    if (word === "=") defaultValue = words.shift() ?? "";
    else if (ruleWords.has(word)) rules.add(word);
    else encodings = [word, ...words].join(" "); // hp-12.2-1: the same on both sides, or no match
  }
  return {
    id,
    name,
    type,
    typeName,
    isRequired: rules.has("required"),
    isOptional: rules.has("optional"),
    isDeprecated: rules.has("deprecated"),
    defaultValue,
    isKey: rules.has("key"),
    encodings,
    unit,
    frame,
  };
}

function readValue(line: string): ValueText | undefined {
  const [name, behind] = split(line, " = ");
  const [number, type] = split(behind, ": ");
  return name === "" || number === "" ? undefined : { name, number, type };
}

/** "`x: int32` there and `x: double` here" */
function twoSides(there: string, here: string): string {
  return `\`${printable(there)}\` there and \`${here}\` here`;
}

function agrees(a: string, b: string): boolean {
  return a === "" || b === "" || a === b;
}

function needsValue(field: FieldText): boolean {
  return field.isRequired && !field.isDeprecated;
}

function isSameField(written: FieldText, wanted: FieldText): boolean {
  const isSame =
    written.name === wanted.name &&
    written.type === wanted.type &&
    written.typeName === wanted.typeName &&
    written.isKey === wanted.isKey &&
    written.encodings === wanted.encodings &&
    agrees(written.unit, wanted.unit) &&
    agrees(written.frame, wanted.frame);
  if (!isSame || (needsValue(wanted) && !needsValue(written))) return false;
  // A deprecated field is neither written nor read.
  if (written.isDeprecated || wanted.isDeprecated) return true;
  const isNumber = wanted.defaultValue !== "";
  return (
    written.defaultValue === wanted.defaultValue &&
    (!isNumber || written.isOptional === wanted.isOptional)
  );
}

/** Compares the types of one message, beginning with its table. */
class MessageComparison {
  private readonly seen = new Set<string>();
  private readonly open: string[] = [];

  /** @param isRequest  the client writes */
  constructor(
    private readonly client: InterfaceText,
    private readonly server: InterfaceText,
    private readonly isRequest: boolean,
  ) {}

  run(table: string): string | undefined {
    this.reach(table);
    for (let name = this.open.pop(); name !== undefined; name = this.open.pop()) {
      const difference = this.compare(name);
      if (difference !== undefined) return difference;
    }
    return undefined;
  }

  private reach(name: string): void {
    if (name === "" || this.seen.has(name)) return;
    this.seen.add(name);
    this.open.push(name);
  }

  private compare(name: string): string | undefined {
    const here = this.client.types.get(name);
    const there = this.server.types.get(name);
    if (here === undefined || there === undefined) {
      return `type \`${printable(name)}\` is missing in the text of one side`;
    }
    if (here.head !== there.head) return `a type is ${twoSides(there.head, here.head)}`;
    if (here.kind === "struct" && here.members.length !== there.members.length) {
      return `\`${here.head}\` has other fields there`;
    }
    const isRecord = here.kind === "table" || here.kind === "struct";
    return isRecord ? this.compareFields(here, there) : this.compareValues(here, there);
  }

  private compareFields(here: TypeText, there: TypeText): string | undefined {
    const [writer, reader] = this.isRequest ? [here, there] : [there, here];
    for (const line of reader.members) {
      const wanted = readField(line);
      if (wanted === undefined) return `a field cannot be read: \`${printable(line)}\``;
      const other = writer.members.find((candidate) => split(candidate, " ")[0] === wanted.id);
      if (other === undefined) {
        if (here.kind !== "struct" && !needsValue(wanted)) continue;
        const side = this.isRequest ? "here" : "there";
        return `field \`${printable(line)}\` of \`${here.head}\` is missing ${side}`;
      }
      const written = readField(other);
      if (written === undefined) return `a field cannot be read: \`${printable(other)}\``;
      if (!isSameField(written, wanted)) {
        const sides = this.isRequest ? twoSides(line, other) : twoSides(other, line);
        return `field ${wanted.id} of \`${here.head}\` is ${sides}`;
      }
      this.reach(wanted.typeName);
    }
    return undefined;
  }

  private compareValues(here: TypeText, there: TypeText): string | undefined {
    for (const line of here.members) {
      const ours = readValue(line);
      if (ours === undefined) return `a value cannot be read: \`${line}\``;
      for (const other of there.members) {
        const theirs = readValue(other);
        if (theirs === undefined) return `a value cannot be read: \`${printable(other)}\``;
        const isName = ours.name === theirs.name;
        const isNumber = ours.number === theirs.number;
        if (isName !== isNumber || (isName && ours.type !== theirs.type)) {
          return `a value of \`${here.head}\` is ${twoSides(other, line)}`;
        }
        if (isName) this.reach(split(ours.type, " ")[1]);
      }
    }
    return undefined;
  }
}

function compareMethods(
  client: InterfaceText,
  here: MethodText,
  server: InterfaceText,
  there: MethodText,
): string | undefined {
  if (here.name !== there.name) return `it is ${twoSides(there.name, here.name)}`;
  if (here.manner !== there.manner) {
    const words = (manner: string): string => (manner === "" ? "a call with a reply" : manner);
    return `it is ${twoSides(words(there.manner), words(here.manner))}`;
  }
  if (here.isIdempotent && !there.isIdempotent) {
    return "it is idempotent here, so that it would be repeated, and not there";
  }
  if (here.request !== there.request) return `it takes ${twoSides(there.request, here.request)}`;
  if (here.reply !== there.reply) return `it gives ${twoSides(there.reply, here.reply)}`;
  return (
    new MessageComparison(client, server, true).run(split(here.request, " ")[1]) ??
    new MessageComparison(client, server, false).run(split(here.reply, " ")[1])
  );
}

/** Why a client with one text does not understand a server with the other; undefined: it does. */
export function findObstacle(client: string, server: string): string | undefined {
  const ours = readInterface(client);
  const theirs = readInterface(server);
  if (ours === undefined || theirs === undefined) {
    return "the text of its interface cannot be read";
  }
  if (ours.name !== theirs.name) return `the interface is ${twoSides(theirs.name, ours.name)}`;
  for (const method of ours.methods) {
    const words = `method '${method.name}' (id ${method.id})`;
    const other = theirs.methods.find((candidate) => candidate.id === method.id);
    if (other === undefined) return `${words} is missing there`;
    const difference = compareMethods(ours, method, theirs, other);
    if (difference !== undefined) return `${words}: ${difference}`;
  }
  return undefined;
}
