import {signal, type Signal} from '@preact/signals';
import {recall, remember} from './kept';

const kKey = 'rtpm.sound';
const kToneHz = 880;
const kToneS = 0.25;
const kVolume = 0.2;

/** One short tone per new alarm, unless it is muted. */
export class AlarmSound {
  readonly isOn: Signal<boolean> = signal(recall(kKey) !== 'off');
  /** Browsers allow sound only after a press or a key. */
  readonly isAllowed: Signal<boolean> = signal(false);
  private context: AudioContext | null = null;
  private lastAlarm: number | null = null;
  /** For tests. */
  toneCount = 0;

  /** Waits for the first press. */
  start(): void {
    const allow = () => {
      for (const name of ['pointerdown', 'keydown']) window.removeEventListener(name, allow, true);
      this.context = new AudioContext();
      this.isAllowed.value = true;
    };
    for (const name of ['pointerdown', 'keydown']) window.addEventListener(name, allow, true);
  }

  set(isOn: boolean): void {
    this.isOn.value = isOn;
    remember(kKey, isOn ? 'on' : 'off');
    if (isOn) this.play();
  }

  /** @param alarm  the newest alarm that nobody has acknowledged; 0: none */
  take(alarm: number): void {
    // Those from before the page was opened are shown, not sounded.
    const isNew = this.lastAlarm !== null && alarm > this.lastAlarm;
    this.lastAlarm = Math.max(alarm, this.lastAlarm ?? 0);
    if (isNew && this.isOn.value) this.play();
  }

  private play(): void {
    ++this.toneCount;
    const {context} = this;
    if (context === null) return;
    void context.resume();
    const tone = context.createOscillator();
    const volume = context.createGain();
    tone.frequency.value = kToneHz;
    volume.gain.setValueAtTime(kVolume, context.currentTime);
    volume.gain.exponentialRampToValueAtTime(0.001, context.currentTime + kToneS);
    tone.connect(volume).connect(context.destination);
    tone.start();
    tone.stop(context.currentTime + kToneS);
  }
}
