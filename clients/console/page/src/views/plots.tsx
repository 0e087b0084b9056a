import {Empty} from '../parts/parts';

export function PlotsView() {
  return <Empty>Nothing yet.</Empty>;
}
