#include "laboratory/plan.hpp"

#include <algorithm>

namespace rtpm::laboratory {
namespace {

/// The programs of a cycle, found by walking from a program that can't start to one it waits for.
std::vector<std::size_t> cycle_among(const std::vector<ProgramPlan>& programs,
                                     const std::vector<bool>& is_placed) {
  std::vector<std::size_t> path;
  auto at = static_cast<std::size_t>(std::ranges::find(is_placed, false) - is_placed.begin());
  for (;;) {
    const auto seen = std::ranges::find(path, at);
    if (seen != path.end()) return {seen, path.end()};
    path.push_back(at);
    for (const std::size_t other : programs[at].after) {
      if (is_placed[other]) continue;
      at = other;
      break;
    }
  }
}

void unify(std::vector<std::size_t>& list) {
  std::ranges::sort(list);
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

void add_uses(Plan& plan) {
  for (ProgramPlan& program : plan.programs) {
    const auto use = [&](const Text& text) {
      const auto used = text.programs();
      program.uses.insert(program.uses.end(), used.begin(), used.end());
    };
    std::ranges::for_each(program.command, use);
    for (const auto& variable : program.environment)
      use(variable.second);
    unify(program.uses);
    for (const std::size_t used : program.uses) {
      program.after.push_back(used);
      ProgramPlan& other = plan.programs[used];
      other.has_url = true;
      if (other.readiness == Readiness::kStart) other.readiness = Readiness::kUrl;
    }
    unify(program.after);
  }
}

void give_registry(Plan& plan, std::size_t registry) {
  for (std::size_t i = 0; i < plan.programs.size(); ++i) {
    ProgramPlan& program = plan.programs[i];
    const bool has_own = std::ranges::any_of(program.environment, [](const auto& variable) {
      return variable.first == kRegistryVariable;
    });
    if (i == registry || has_own || comes_after(plan.programs, registry, i)) continue;
    Text url;
    url.append_url_of(registry);
    program.environment.emplace_back(kRegistryVariable, std::move(url));
  }
}

}  // namespace

Text::Text(std::string literal) {
  append(std::move(literal));
}

void Text::append(std::string literal) {
  if (!literal.empty()) pieces_.push_back({.literal = std::move(literal)});
}

void Text::append_url_of(std::size_t program) {
  pieces_.push_back({.url_of = program});
}

std::vector<std::size_t> Text::programs() const {
  std::vector<std::size_t> programs;
  for (const Piece& piece : pieces_) {
    if (piece.url_of) programs.push_back(*piece.url_of);
  }
  return programs;
}

std::string Text::resolved(const std::vector<std::string>& urls) const {
  std::string text;
  for (const Piece& piece : pieces_)
    text += piece.url_of ? urls[*piece.url_of] : piece.literal;
  return text;
}

bool Plan::has_terminal() const {
  return std::ranges::any_of(
      programs, [](const ProgramPlan& program) { return program.output == Output::kTerminal; });
}

Duration Plan::stop_patience() const {
  Duration whole = std::chrono::seconds{1};
  for (const ProgramPlan& program : programs)
    whole += program.stop_patience;
  return whole;
}

Duration Plan::longest_stop_patience() const {
  Duration longest{};
  for (const ProgramPlan& program : programs)
    longest = std::max(longest, program.stop_patience);
  return longest;
}

void connect(Plan& plan) {
  add_uses(plan);
  if (!plan.registry_program) return;
  give_registry(plan, *plan.registry_program);
  add_uses(plan);
}

std::vector<std::size_t> start_order(const std::vector<ProgramPlan>& programs,
                                     std::vector<std::size_t>& cycle) {
  std::vector<std::size_t> order;
  std::vector<bool> is_placed(programs.size());
  while (order.size() < programs.size()) {
    const auto can_start = [&](std::size_t i) {
      return !is_placed[i] && std::ranges::all_of(programs[i].after, [&](std::size_t other) {
        return is_placed[other];
      });
    };
    std::size_t next = 0;
    while (next < programs.size() && !can_start(next))
      ++next;
    if (next == programs.size()) {
      cycle = cycle_among(programs, is_placed);
      return {};
    }
    is_placed[next] = true;
    order.push_back(next);
  }
  return order;
}

bool comes_after(const std::vector<ProgramPlan>& programs, std::size_t program, std::size_t other) {
  std::vector<bool> is_seen(programs.size());
  std::vector<std::size_t> open{program};
  while (!open.empty()) {
    const std::size_t at = open.back();
    open.pop_back();
    if (at == other && at != program) return true;
    if (is_seen[at]) continue;
    is_seen[at] = true;
    for (const std::size_t before : programs[at].after) {
      if (before == other) return true;
      open.push_back(before);
    }
  }
  return false;
}

}  // namespace rtpm::laboratory
