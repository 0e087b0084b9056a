/** All texts of the page: English, then German. A section a view; `texts.value.live` is shown. */
import {computed, effect, signal} from '@preact/signals';

const kTexts = {
  views: {
    overview: ['Overview', 'Übersicht'],
    live: ['Live', 'Live'],
    plots: ['Plots', 'Kurven'],
    parameters: ['Parameters', 'Parameter'],
    recordings: ['Recordings', 'Aufnahmen'],
    incidents: ['Incidents', 'Vorfälle'],
    events: ['Events', 'Ereignisse'],
  },
} as const;

export const kLanguages = ['en', 'de'] as const;
export type Language = (typeof kLanguages)[number];

type Widened<T> = T extends string ? string : T;
type Section<T> = {
  readonly [Key in keyof T]: T[Key] extends readonly [infer English, unknown]
    ? Widened<English>
    : never;
};
export type Texts = {readonly [Name in keyof typeof kTexts]: Section<(typeof kTexts)[Name]>};

const kKey = 'rtpm.language';
const wanted = localStorage.getItem(kKey) ?? navigator.language.slice(0, 2);
export const language = signal<Language>(kLanguages.find((one) => one === wanted) ?? 'en');
export const texts = computed(() => inLanguage(language.value));

effect(() => {
  document.documentElement.lang = language.value;
});

export function choose(wantedLanguage: Language): void {
  language.value = wantedLanguage;
  localStorage.setItem(kKey, wantedLanguage);
}

function inLanguage(wantedLanguage: Language): Texts {
  const at = kLanguages.indexOf(wantedLanguage);
  const sections = Object.entries(kTexts).map(([name, section]) => [
    name,
    Object.fromEntries(Object.entries(section).map(([key, both]) => [key, both[at]])),
  ]);
  return Object.fromEntries(sections) as Texts;
}
