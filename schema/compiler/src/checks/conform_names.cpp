#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/schema/conform.hpp"

namespace rtpm::schema {
namespace {

std::string who_breaks(const Change& change) {
  if (change.breaks_old_clients && change.breaks_new_clients) {
    return "old clients with new servers, and new clients with old servers";
  }
  return change.breaks_old_clients ? "old clients with new servers"
                                   : "new clients with old servers";
}

std::string with_word(const Change& change, std::string_view word) {
  std::string text = render(change.diagnostic);
  constexpr std::string_view kError = ": error: ";
  text.replace(text.find(kError), kError.size(), ": " + std::string(word) + ": ");
  return text + "breaks: " + who_breaks(change) + " [" + std::string(name_of(change.kind)) + "]\n";
}

std::string in_a_line(const Change& change) {
  std::string place = change.diagnostic.location.file;
  if (change.diagnostic.location.line != 0) {
    place += ':' + std::to_string(change.diagnostic.location.line) + ':' +
             std::to_string(change.diagnostic.location.column);
  }
  return place + ": compatible: " + change.diagnostic.message + " [" +
         std::string(name_of(change.kind)) + "]\n";
}

}  // namespace

std::string_view name_of(ChangeKind kind) noexcept {
  constexpr std::array<std::string_view, 45> kNames{"service-added",       "service-removed",
                                                    "priority-changed",    "method-added",
                                                    "method-removed",      "method-renamed",
                                                    "method-renumbered",   "payload-replaced",
                                                    "payload-kind",        "idempotent-added",
                                                    "idempotent-removed",  "manner-changed",
                                                    "deferred-changed",    "deadline-changed",
                                                    "max-size-raised",     "max-size-lowered",
                                                    "type-added",          "type-removed",
                                                    "type-kind",           "struct-layout",
                                                    "event-added",         "event-changed",
                                                    "field-added",         "field-added-required",
                                                    "field-removed",       "field-moved",
                                                    "field-renamed",       "field-retyped",
                                                    "field-default",       "field-required",
                                                    "field-not-required",  "field-deprecated",
                                                    "field-undeprecated",  "field-key",
                                                    "field-encoding",      "field-unit",
                                                    "field-frame",         "field-range-narrowed",
                                                    "field-range-widened", "enum-underlying",
                                                    "enum-value-added",    "enum-value-removed",
                                                    "enum-value-renamed",  "enum-value-renumbered",
                                                    "union-member-retyped"};
  static_assert(kNames.size() == static_cast<std::size_t>(ChangeKind::kUnionMemberRetyped) + 1);
  return kNames[static_cast<std::size_t>(kind)];
}

std::string render(const std::vector<Change>& changes) {
  std::string text;
  for (const auto& [verdict, word] : {std::pair{Verdict::kIncompatible, "error"},
                                      {Verdict::kServersFirst, "warning"},
                                      {Verdict::kCompatible, ""}}) {
    for (const Change& change : changes) {
      if (change.verdict != verdict) continue;
      text += verdict == Verdict::kCompatible ? in_a_line(change) : with_word(change, word);
    }
  }
  return text;
}

}  // namespace rtpm::schema
