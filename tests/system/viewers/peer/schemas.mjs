// Decoders of FlatBuffers as viewers have them: flatbuffers_reflection of npm, and the loader of
// Lichtblick around it.
import { transform } from "esbuild";
import { ByteBuffer } from "flatbuffers";
import { BaseType, Parser, Schema, Table } from "flatbuffers_reflection";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { join } from "node:path";

// Refuses what Lichtblick's loader refuses: unions and arrays anywhere in the schema.
function refuse(schema) {
  for (let i = 0; i < schema.objectsLength(); ++i) {
    const object = schema.objects(i);
    for (let k = 0; k < object.fieldsLength(); ++k) {
      const field = object.fields(k);
      const types = [field.type().baseType(), field.type().element()];
      if (types.includes(BaseType.Union) || types.includes(BaseType.Array))
        throw new Error(`${object.name()}.${field.name()} is a union or an array`);
    }
  }
}

function plainDecoder(name, bytes) {
  const schema = Schema.getRootAsSchema(new ByteBuffer(bytes));
  refuse(schema);
  const index = Array.from({ length: schema.objectsLength() }, (_, i) =>
    schema.objects(i).name()).indexOf(name);
  if (index < 0) throw new Error(`${name} is not in its schema`);
  if (schema.rootTable()?.name() !== name) throw new Error(`${name} is not the root`);
  const read = new Parser(schema).toObjectLambda(index, true);
  return (data) => {
    const buffer = new ByteBuffer(data);
    const root = buffer.readInt32(buffer.position()) + buffer.position();
    return read(new Table(buffer, index, root, false));
  };
}

// The loader of a source folder of Lichtblick: (name, bytes) => decode.
export async function lichtblickDecoder(folder) {
  const file = join(folder, "packages/mcap-support/src/parseFlatbufferSchema.ts");
  const { code } = await transform(await readFile(file, "utf8"), { loader: "ts", format: "esm" });
  // Beside this file, where its imports are found.
  const own = await mkdtemp(join(import.meta.dirname, "lichtblick-"));
  await writeFile(join(own, "loader.mjs"), code);
  const { parseFlatbufferSchema } = await import(join(own, "loader.mjs"));
  await rm(own, { recursive: true });
  return (name, bytes) => parseFlatbufferSchema(name, bytes).deserialize;
}

export async function decoderOf(folder) {
  return folder ? lichtblickDecoder(folder) : plainDecoder;
}

// A decoder for messages of a channel; what the viewer says where it refuses the channel.
export function opened(makeDecoder, channel) {
  try {
    if (channel.encoding === "json")
      return { decode: (data) => JSON.parse(new TextDecoder().decode(data)) };
    if (channel.encoding !== "flatbuffer") throw new Error(`encoding ${channel.encoding}`);
    return { decode: makeDecoder(channel.schemaName, channel.schema) };
  } catch (error) {
    return { refusal: error.message };
  }
}

// For JSON.stringify(): numbers beyond 2^53 become texts.
export function plain(key, value) {
  if (value instanceof Uint8Array) return [...value];
  if (typeof value !== "bigint") return value;
  return Number.isSafeInteger(Number(value)) ? Number(value) : String(value);
}
