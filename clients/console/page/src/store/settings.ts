import {computed, signal} from '@preact/signals';
import {language} from '../texts/texts';
import {recall, remember} from './kept';

/** How numbers are shown, by the choice of this browser. */

export type Angle = 'degrees' | 'radians';
/** The decimal mark. */
export type Mark = 'point' | 'comma';

const kAngleKey = 'rtpm.angle';
const kMarkKey = 'rtpm.mark';
const kMarks: readonly Mark[] = ['point', 'comma'];

export const angle = signal<Angle>(recall(kAngleKey) === 'radians' ? 'radians' : 'degrees');

const chosenMark = signal<Mark | null>(kMarks.find((one) => one === recall(kMarkKey)) ?? null);
/** Until one is chosen, as the language has it. */
export const mark = computed<Mark>(
  () => chosenMark.value ?? (language.value === 'de' ? 'comma' : 'point'),
);

export function chooseAngle(wanted: Angle): void {
  angle.value = wanted;
  remember(kAngleKey, wanted);
}

export function chooseMark(wanted: Mark): void {
  chosenMark.value = wanted;
  remember(kMarkKey, wanted);
}
