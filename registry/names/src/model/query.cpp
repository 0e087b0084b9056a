#include "model/query.hpp"

#include <memory>
#include <optional>
#include <utility>

#include "model/properties.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/policy.hpp"
#include "rtpm/predicate/preference.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::names {
namespace {

predicate::TypeOfProperty types_of(const InterfaceIndex& index, std::string_view interface) {
  return [&index, interface](std::string_view name) -> std::optional<PropertyType> {
    if (const auto type = index.type_of(interface, name)) return type;
    if (is_built_in(name)) return PropertyType::kText;
    return std::nullopt;
  };
}

/// A note on properties in the query texts that no name of the interface has.
std::string note_on(const InterfaceIndex& index, std::string_view interface,
                    const predicate::Expression& expression) {
  std::string note;
  for (const auto& mention : expression.mentions()) {
    if (is_built_in(mention.name) || index.has(interface, mention.name)) continue;
    const std::string which = interface.empty() ? "no name" : "no name of " + printable(interface);
    note += (note.empty() ? "" : "; ") + which + " has the property '" + printable(mention.name) +
            "'" + program::suggestion(mention.name, index.properties_of(interface));
  }
  return note;
}

}  // namespace

expected<predicate::Predicate, QueryError> parse_predicate(const InterfaceIndex& index,
                                                           std::string_view interface,
                                                           std::string_view text) {
  auto parsed = predicate::Predicate::parse(text, types_of(index, interface));
  if (!parsed) return unexpected{QueryError{Outcome::kBadPredicate, std::move(parsed.error())}};
  return std::move(*parsed);
}

expected<Found, QueryError> find(const InterfaceIndex& index, const QueryTexts& texts,
                                 std::size_t count_max, std::uint64_t random,
                                 const rpc::Caller* caller) {
  const auto wanted = parse_predicate(index, texts.interface, texts.predicate);
  if (!wanted) return unexpected{wanted.error()};
  const auto preference =
      predicate::Preference::parse(texts.preference, types_of(index, texts.interface));
  if (!preference) {
    return unexpected{QueryError{Outcome::kBadPreference, preference.error()}};
  }
  Found found;
  found.note = note_on(index, texts.interface, wanted->expression());
  std::vector<const Record*> accepted;
  index.for_each(texts.interface, [&](const Record& record) {
    if (!may_see(caller, record.name) || !wanted->accepts(RecordProperties(record))) return;
    ++found.accepted_count;
    if (!preference->is_first() || accepted.size() < count_max) accepted.push_back(&record);
  });
  std::vector<std::unique_ptr<RecordProperties>> sources;
  std::vector<const predicate::PropertySource*> candidates;
  for (const Record* record : accepted) {
    sources.push_back(std::make_unique<RecordProperties>(*record));
    candidates.push_back(sources.back().get());
  }
  for (const std::size_t number : preference->order(candidates, random)) {
    if (found.records.size() == count_max) break;
    found.records.push_back(accepted[number]);
  }
  return found;
}

}  // namespace rtpm::names
