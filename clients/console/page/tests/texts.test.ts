import {readdirSync, readFileSync} from 'node:fs';
import {describe, expect, it} from 'vitest';
import ts from 'typescript';
import {kTexts} from '../src/texts/texts';

const folder = new URL('../src/', import.meta.url);
/** Names, units and marks are the same in every language. */
const kSame = /^(RTPM console|REC|REPLAY|[^A-Za-z]*|[A-Za-zµ°]{1,2}|rad)$/;
const kShown = new Set([
  'title',
  'label',
  'aria-label',
  'placeholder',
  'question',
  'confirm',
  'alt',
]);

/** The words that a source shows by itself: text between tags, and in attributes that are read. */
function wordsOf(path: string): string[] {
  const source = ts.createSourceFile(
    path,
    readFileSync(new URL(path, folder), 'utf8'),
    ts.ScriptTarget.Latest,
    true,
    ts.ScriptKind.TSX,
  );
  const found: string[] = [];
  const take = (text: string) => {
    const words = text.replace(/\s+/g, ' ').trim();
    if (!kSame.test(words)) found.push(words);
  };
  const look = (node: ts.Node): void => {
    if (ts.isJsxText(node)) take(node.text);
    if (ts.isJsxAttribute(node) && kShown.has(node.name.getText(source))) {
      literals(node.initializer, take);
    }
    if (ts.isJsxExpression(node) && !ts.isJsxAttribute(node.parent)) {
      literals(node.expression, take);
    }
    ts.forEachChild(node, look);
  };
  look(source);
  return found;
}

/** String literals that an expression may give: itself, or a branch of it. */
function literals(node: ts.Node | undefined, take: (text: string) => void): void {
  if (node === undefined) return;
  if (ts.isStringLiteral(node) || ts.isNoSubstitutionTemplateLiteral(node)) take(node.text);
  if (ts.isTemplateExpression(node)) {
    [node.head, ...node.templateSpans.map((span) => span.literal)].forEach((part) =>
      take(part.text),
    );
  }
  if (ts.isJsxExpression(node)) literals(node.expression, take);
  if (ts.isConditionalExpression(node)) {
    literals(node.whenTrue, take);
    literals(node.whenFalse, take);
  }
  if (ts.isBinaryExpression(node)) literals(node.right, take);
}

describe('texts', () => {
  const all = Object.entries(kTexts).flatMap(([section, texts]) =>
    Object.entries(texts).map(([key, both]): [string, readonly unknown[]] => [
      `${section}.${key}`,
      both,
    ]),
  );

  it('are there in English and in German', () => {
    const isText = (one: unknown) =>
      typeof one === 'string' ? one !== '' : one instanceof Function;
    expect(all.filter(([, both]) => both.length !== 2 || !both.every(isText))).toEqual([]);
  });

  it('take the same values in both', () => {
    const kinds = (one: unknown) => (one instanceof Function ? one.length : typeof one);
    expect(all.filter(([, [english, german]]) => kinds(english) !== kinds(german))).toEqual([]);
  });

  it('are not in the views', () => {
    const files = readdirSync(folder, {recursive: true, encoding: 'utf8'})
      .filter((path) => path.endsWith('.tsx'))
      .sort();
    expect(files.flatMap((path) => wordsOf(path).map((words) => `${path}: ${words}`))).toEqual([]);
  }, 60_000);
});
