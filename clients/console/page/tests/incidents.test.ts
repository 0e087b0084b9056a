import {describe, expect, it} from 'vitest';
import {chosen, readIncidents, toCsv} from '../src/model/incidents';

const kList = readIncidents({
  incidents: [
    {
      id: 2,
      who: 'lab/arm0',
      what: 'lost',
      why: 'it "hangs", or is cut off',
      severity: 'alarm',
      since_ns: 1_700_000_000_000_000_000n,
      until_ns: 0,
      count: 3,
      recording: 'run.mcap',
    },
    {
      id: 1,
      who: '=cmd()',
      what: 'lease',
      severity: 'info',
      since_ns: 1_600_000_000_000_000_000n,
      until_ns: 1_600_000_001_500_000_000n,
      acknowledged_by: 'Anna',
      acknowledged_ns: 1_600_000_002_000_000_000n,
    },
  ],
  count: 2,
  dropped_count: 0,
});

describe('incidents', () => {
  it('are read with what is absent', () => {
    expect(kList.incidents[0]).toMatchObject({untilNs: null, acknowledgedNs: null, count: 3});
    expect(kList.incidents[1]).toMatchObject({why: '', count: 1, acknowledgedBy: 'Anna'});
  });

  it('are chosen by what is to do, and by a text of any field', () => {
    const ids = (...args: Parameters<typeof chosen>) => chosen(...args).map((one) => one.id);
    expect(ids(kList.incidents, 'unseen', '')).toEqual([2]);
    expect(ids(kList.incidents, 'open', '')).toEqual([2]);
    expect(ids(kList.incidents, 'all', '')).toEqual([2, 1]);
    expect(ids(kList.incidents, 'all', ' ANNA ')).toEqual([1]);
    expect(ids(kList.incidents, 'all', 'run.mcap')).toEqual([2]);
  });

  it('are a table that a spreadsheet reads without running anything', () => {
    const [head, lost, lease] = toCsv(kList.incidents).split('\r\n');
    expect(head).toBe(
      'id,severity,who,what,why,since,until,seconds,count,acknowledged by,acknowledged,recording',
    );
    expect(lost).toBe(
      '2,alarm,lab/arm0,lost,"it ""hangs"", or is cut off",2023-11-14T22:13:20.000Z,,,3,,,run.mcap',
    );
    expect(lease).toContain("1,info,'=cmd(),lease,,2020-09-13T12:26:40.000Z");
    expect(lease).toContain(',1.500,1,Anna,');
  });
});
