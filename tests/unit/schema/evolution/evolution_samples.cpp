#include "evolution_samples.hpp"

#include <set>
#include <string>

namespace rtpm::schema::test {

std::vector<EvolutionSample> evolution_samples() {
  std::vector<EvolutionSample> samples;
  std::set<ChangeKind> seen;
  for (unsigned seed = 0; seed < 400; ++seed) {
    Random random(seed);
    EvolutionSample sample;
    sample.before = random_schema(random);
    sample.before.name_space = "lab" + std::to_string(samples.size());
    sample.after = sample.before;
    const auto kind = edit(sample.after, random);
    if (!kind || sample.before.text() == sample.after.text() || !seen.insert(*kind).second)
      continue;
    sample.kind = *kind;
    samples.push_back(std::move(sample));
  }
  return samples;
}

std::string sample_message(Side& side, const Payload& payload, std::uint16_t method,
                           bool is_request) {
  Random random(2U * method + (is_request ? 1U : 0U));
  return side.write(side.model().objects[payload.table].name, payload.kind, random);
}

}  // namespace rtpm::schema::test
