#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "model/interface_index.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/names/outcome.hpp"
#include "rtpm/predicate/predicate.hpp"
#include "rtpm/predicate/text_error.hpp"
#include "rtpm/rpc/caller.hpp"

namespace rtpm::names {

/// The criteria of find().
struct QueryTexts {
  std::string_view interface {};  ///< Any if empty.
  std::string_view predicate{};
  std::string_view preference{};
};

/// The result of find(), preferred records first.
struct Found {
  std::vector<const Record*> records{};  ///< Valid until the next change.
  std::size_t accepted_count = 0;        ///< Includes records beyond the limit.
  std::string note{};                    ///< Names properties that no name has; empty if none.
};

/// Why a predicate or preference is refused.
struct QueryError {
  Outcome outcome = Outcome::kBadPredicate;  ///< kBadPredicate or kBadPreference.
  predicate::TextError error{};
};

/// Parses a predicate and checks its types by the index. A property that no name has is not an
/// error: a name with it may still be bound.
/// @errors   the predicate or preference is malformed, or compares incompatible types
[[nodiscard]] expected<predicate::Predicate, QueryError> parse_predicate(
    const InterfaceIndex& index, std::string_view interface, std::string_view text);

/// Returns at most `count_max` records that `caller` may_see(); `random` provides the order for the
/// preference "random".
/// @errors   those of parse_predicate()
[[nodiscard]] expected<Found, QueryError> find(const InterfaceIndex& index, const QueryTexts& texts,
                                               std::size_t count_max, std::uint64_t random,
                                               const rpc::Caller* caller = nullptr);

}  // namespace rtpm::names
