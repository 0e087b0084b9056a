// Recordings of the mock under review: curves by formulas, markers, trials and incidents.

const kSecond = 1e9;
const axes = ['x', 'y', 'z'];
const kFields = ['arm0', 'arm1'].flatMap((name) => [
  ...axes.map((axis) => ({path: `lab/${name}/sampled.position_m.${axis}`, unit: 'm'})),
  ...axes.map((axis) => ({path: `lab/${name}/sampled.force_newton.${axis}`, unit: 'N'})),
  {path: `lab/${name}/sampled.success_rate`, unit: ''},
]);

function valueOf(field, timeS) {
  const at = kFields.findIndex((one) => one.path === field);
  const scale = field.includes('force') ? 2 : 0.08;
  return scale * Math.sin(timeS * (0.7 + 0.31 * at) + at) * Math.cos(timeS * 0.05);
}

export class Reviews {
  #files;
  #notes = new Map();
  #deleted = [];
  #begun = new Map();

  /** @param files  the list that the mock shows, which is changed here */
  constructor(files) {
    this.#files = files;
  }

  get deleted() {
    return this.#deleted.map(({entry, ...one}) => one);
  }

  #find(file) {
    const found = this.#files.find((one) => one.file === file);
    if (!found) throw new Error(`there is no recording '${file}'`);
    return found;
  }

  #notesOf(file) {
    return this.#notes.get(file) ?? [];
  }

  services() {
    return {
      review_open: ({file}) => {
        const {begin_ns, end_ns, message_count, is_complete, session} = this.#find(file);
        const begun = this.#begun.get(file) ?? Date.now();
        this.#begun.set(file, begun);
        const lengthS = (end_ns - begin_ns) / kSecond;
        const at = (share) => begin_ns + Math.round(share * lengthS) * kSecond;
        const trials = [0, 1, 2, 3].map((i) => ({
          begin_ns: at(0.1 + 0.2 * i),
          end_ns: at(0.25 + 0.2 * i),
          number: i + 1,
          condition: i % 2 === 0 ? 'soft' : 'stiff',
          response: i % 2 === 0 ? 'same' : 'other',
        }));
        const incident = (share, kind, device, what, endShare) => ({
          begin_ns: at(share),
          end_ns: endShare ? at(endShare) : null,
          kind,
          device,
          what,
        });
        const markers = [0.05, 0.31, 0.9].map((share, i) => ({
          time_ns: at(share),
          label: ['start', 'repeat', 'end'][i],
        }));
        const incidents = [
          incident(0.37, 'fault', 'lab/arm0', 'force clamped', 0.38),
          incident(0.62, 'stop', 'lab/arm0', 'emergency stop', 0.66),
          incident(0.8, 'lost', 'lab/arm1', 'device gone'),
          incident(0.02, 'lease', 'lab/arm0', 'the lease is held'),
        ];
        return {
          begin_ns,
          end_ns,
          message_count,
          is_complete,
          problem: '',
          progress: Math.min(1, (Date.now() - begun) / 1500),
          session: session ?? {},
          fields: kFields,
          omitted_field_count: 0,
          unreadable_topics: [],
          markers,
          marker_count: markers.length,
          trials,
          trial_count: trials.length,
          incidents,
          incident_count: incidents.length,
          notes: this.#notesOf(file),
          notes_problem: '',
          cut: null,
        };
      },
      review_series: ({file, fields, begin_ns, end_ns, points}) => {
        const {begin_ns: first} = this.#find(file);
        const lengthS = (end_ns - begin_ns) / kSecond;
        const beginS = (begin_ns - first) / kSecond;
        const isExact = lengthS * 1000 <= points;
        const count = isExact ? Math.ceil(lengthS * 1000) : points;
        const stepS = lengthS / count;
        const series = fields.map((field) => {
          const values = Array.from({length: count}, (_, i) => valueOf(field, beginS + i * stepS));
          if (!isExact) return {field, low: values.map((v) => v - 0.002), high: values};
          return {field, offset_ns: values.map((_, i) => Math.round(i * stepS * kSecond)), values};
        });
        return {
          begin_ns,
          bucket_ns: Math.round(stepS * kSecond),
          is_exact: isExact,
          progress: 1,
          series,
          ...(isExact ? {markers: [], trials: [], incidents: []} : {}),
        };
      },
      recording_annotate: ({file, time_ns, text, made_ns}) => {
        this.#find(file);
        const notes = this.#notesOf(file);
        const kept = text
          ? [...notes, {time_ns, text, made_ns: Date.now() * 1e6}]
          : notes.filter((one) => one.time_ns !== time_ns || one.made_ns !== made_ns);
        this.#notes.set(file, kept);
        return {notes: kept};
      },
      recording_cut: ({file, begin_ns, end_ns, name}) => {
        this.#need(name);
        this.#files.push({...this.#find(file), file: name, begin_ns, end_ns});
        return {file: name, message_count: 1000};
      },
      recording_rename: ({file, name}) => {
        this.#need(name);
        this.#find(file).file = name;
        return {file: name};
      },
      recording_delete: ({file}) => {
        const entry = this.#find(file);
        this.#files.splice(this.#files.indexOf(entry), 1);
        const id = `${Date.now()}-${file}`;
        const {byte_count} = entry;
        this.#deleted.push({id, file, deleted_ns: Date.now() * 1e6, byte_count, entry});
        return {id, purged: []};
      },
      recording_restore: ({id}) => {
        const at = this.#deleted.findIndex((one) => one.id === id);
        if (at < 0) throw new Error(`there is no deleted recording '${id}'`);
        const [{entry}] = this.#deleted.splice(at, 1);
        this.#files.push(entry);
        return {file: entry.file};
      },
      recordings_purge: () => ({count: this.#deleted.splice(0).length}),
    };
  }

  #need(name) {
    if (!/^[\w-][\w.-]*\.mcap$/.test(name)) throw new Error(`'${name}' is no name of a recording`);
    if (this.#files.some((one) => one.file === name)) {
      throw new Error(`there is a recording '${name}' already`);
    }
  }
}
