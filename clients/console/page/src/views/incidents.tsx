import {Empty} from '../parts/parts';

export function IncidentsView() {
  return <Empty>Nothing yet.</Empty>;
}
