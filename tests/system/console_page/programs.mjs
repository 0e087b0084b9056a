// The running system beside which the page is tested: registry, devices, force node, console.
import {spawn} from 'node:child_process';
import {existsSync, mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {createInterface} from 'node:readline';

const kPatienceMs = 30_000;

/** A program of RTPM. It is ready when it has printed what `ready` finds. */
export class Program {
  #process;
  #ended;

  static async start(path, args, ready) {
    const program = new Program();
    program.#process = spawn(path, args, {stdio: ['ignore', 'pipe', 'inherit']});
    program.#ended = new Promise((resolve) => program.#process.once('exit', resolve));
    const lines = createInterface({input: program.#process.stdout});
    program.found = await new Promise((resolve, reject) => {
      const timer = setTimeout(
        () => reject(new Error(`${path} did not become ready`)),
        kPatienceMs,
      );
      lines.on('line', (line) => {
        const found = ready.exec(line);
        if (found === null) return;
        clearTimeout(timer);
        resolve(found[0]);
      });
      program.#ended.then((code) => reject(new Error(`${path} ended with ${code}`)));
    });
    return program;
  }

  /** Its memory in MiB, the most so far. */
  peakMiB() {
    const status = readFileSync(`/proc/${this.#process.pid}/status`, 'utf8');
    return Number(/VmHWM:\s+(\d+) kB/.exec(status)[1]) / 1024;
  }

  async end(signal = 'SIGTERM') {
    this.#process.kill(signal);
    const timer = setTimeout(() => this.#process.kill('SIGKILL'), kPatienceMs);
    await this.#ended;
    clearTimeout(timer);
  }
}

const kToken = 'token-of-the-page-test';
const kRtpm = /rtpm:\/\/\S+/;

export class System {
  #folder = process.env.RTPM_PROGRAM_FOLDER;
  #scratch = process.env.RTPM_SCRATCH;
  #stroke = process.env.RTPM_STROKE;
  #programs = [];

  async start() {
    mkdirSync(`${this.#scratch}/recordings`, {recursive: true});
    const registry = await this.#launch('rtpm-registryd', ['--port', '0'], kRtpm);
    this.registry = registry.found;
    this.devices = await this.#launch(
      'rtpm-deviced',
      [
        '--port',
        '0',
        '--registry',
        this.registry,
        '--serve-events',
        '--devices',
        'arm0,arm1,gaze0,biometric0,knob0',
        '--device-arm0-hand',
        this.#stroke,
        '--device-arm1-driver',
        'arm',
        '--device-arm1-free',
        '--settings',
        `${this.#scratch}/settings`,
        '--stops',
        'none',
      ],
      kRtpm,
    );
    await this.startServo();
    await this.startConsole('0');
  }

  /** A camera whose lamp follows the knob's button; false where RTPM is built without cameras. */
  async startCamera() {
    if (!existsSync(`${this.#folder}/rtpm-camerad`)) return false;
    const args = ['--port', '0', '--registry', this.registry, '--medium-cam0-button', 'lab/knob0'];
    this.camera = await this.#launch('rtpm-camerad', args, kRtpm);
    return true;
  }

  /** A further device server, with so many knobs at a low rate. */
  async startKnobs(folder, count) {
    const names = Array.from({length: count}, (_, i) => `knob${i}`);
    const rates = names.flatMap((name) => [`--device-${name}-rate`, '20']);
    const args = ['--port', '0', '--registry', this.registry, '--folder', folder];
    const options = ['--devices', names.join(), ...rates, '--stops', 'none'];
    await this.#launch('rtpm-deviced', [...args, ...options], kRtpm);
  }

  /** Soft, so that a greater stiffness shows in the force. */
  async startServo() {
    this.servo = await this.#launch(
      'rtpm-servo',
      [
        '--registry',
        this.registry,
        '--scene',
        'sphere',
        '--events',
        'rtpm/events',
        '--serve',
        'lab/servo',
        '--stiffness',
        '60',
        '--seconds',
        '100000',
        '--live',
        'off',
      ],
      /lab\/arm0/,
    );
  }

  /** Registry, one device, and a console that serves the page in `folder`. */
  async startWithPage(folder) {
    mkdirSync(`${this.#scratch}/recordings`, {recursive: true});
    const registry = await this.#launch('rtpm-registryd', ['--port', '0'], kRtpm);
    this.registry = registry.found;
    const args = ['--port', '0', '--registry', this.registry, '--events', 'none'];
    const options = ['--stops', 'none', '--settings', '', '--device-arm0-hand', this.#stroke];
    this.devices = await this.#launch('rtpm-deviced', [...args, ...options], kRtpm);
    await this.startConsole('0', ['--page', folder]);
  }

  async startConsole(port, options = []) {
    this.console = await this.#launch(
      'rtpm-console',
      [
        '--port',
        port,
        '--registry',
        this.registry,
        '--token-file',
        this.#tokenFile(),
        '--print-token',
        '--recordings',
        `${this.#scratch}/recordings`,
        '--incidents',
        `${this.#scratch}/incidents.jsonl`,
        ...options,
      ],
      /http:\/\/\S+/,
    );
    this.url = this.console.found;
    this.port = new URL(this.url).port;
  }

  #tokenFile() {
    const file = `${this.#scratch}/token`;
    writeFileSync(file, kToken, {mode: 0o600});
    return file;
  }

  async end() {
    for (const program of this.#programs.reverse()) await program.end();
  }

  async #launch(name, args, ready) {
    const program = await Program.start(`${this.#folder}/${name}`, args, ready);
    this.#programs.push(program);
    return program;
  }
}
