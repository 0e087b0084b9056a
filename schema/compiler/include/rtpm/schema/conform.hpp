#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

/// What became different between two versions of a schema, and who of those that were built from
/// the two still understand each other.
namespace rtpm::schema {

/// Every kind of change.
enum class ChangeKind : std::uint8_t {
  kServiceAdded,
  kServiceRemoved,
  kPriorityChanged,  ///< Of a service: its model or its number.
  kMethodAdded,
  kMethodRemoved,
  kMethodRenamed,     ///< The number stays.
  kMethodRenumbered,  ///< The name stays.
  kPayloadReplaced,   ///< The request or reply is another table.
  kPayloadKind,       ///< It is encoded in another way: bare struct, FlatBuffer, nothing.
  kIdempotentAdded,
  kIdempotentRemoved,
  kMannerChanged,  ///< Oneway, its level, or stream.
  kDeferredChanged,
  kDeadlineChanged,
  kMaxSizeRaised,
  kMaxSizeLowered,
  kTypeAdded,
  kTypeRemoved,
  kTypeKind,      ///< A table became a struct, an enum a union, or the like.
  kStructLayout,  ///< A struct's fields are others, or stand elsewhere.
  kEventAdded,
  kEventChanged,  ///< A table is another event than it was, or none.
  kFieldAdded,
  kFieldAddedRequired,
  kFieldRemoved,
  kFieldMoved,  ///< To another slot.
  kFieldRenamed,
  kFieldRetyped,
  kFieldDefault,
  kFieldRequired,
  kFieldNotRequired,
  kFieldDeprecated,
  kFieldUndeprecated,
  kFieldKey,
  kFieldEncoding,  ///< `nested_flatbuffer`, `flexbuffer` or `force_align`.
  kFieldUnit,
  kFieldFrame,
  kFieldRangeNarrowed,
  kFieldRangeWidened,
  kEnumUnderlying,
  kEnumValueAdded,
  kEnumValueRemoved,
  kEnumValueRenamed,
  kEnumValueRenumbered,
  kUnionMemberRetyped,
};

/// "field-added" of kFieldAdded.
[[nodiscard]] std::string_view name_of(ChangeKind kind) noexcept;

/// What a change does to data.
struct Reading {
  bool new_reads_old = true;  ///< A newer reader takes an older writer's data for what it was.
  bool old_reads_new = true;  ///< The other way round.
  /// A reading that fails does so by meaning alone: the bytes pass, and say something else.
  bool is_by_meaning = false;
};

/// How bad a change is.
enum class Verdict : std::uint8_t {
  kCompatible,    ///< Old and new understand each other in every combination.
  kServersFirst,  ///< Old clients work with new servers, not the other way round.
  kIncompatible,  ///< Old clients do not work with new servers, or what is not a call breaks.
};

/// One change.
struct Change {
  ChangeKind kind{};
  Verdict verdict = Verdict::kCompatible;
  bool breaks_old_clients = false;  ///< With a new server.
  bool breaks_new_clients = false;  ///< With an old server.
  Reading reading{};                ///< Of changes to types.
  std::string owner{};              ///< The type or service, fully qualified.
  Diagnostic diagnostic{};          ///< Where and what; the hint says how to do without it.
};

/// All changes from `before` to `after`, which may be of different files.
///
/// A type counts as far as it is in a request, a reply or an event: in a request, old clients are
/// the writers and servers the readers, in a reply it is the other way round. In an event, and in
/// a type of the file that nothing in it uses, every failed reading is incompatible.
[[nodiscard]] std::vector<Change> compare(const Model& before, const Model& after);

/// The changes for a person: the incompatible ones as errors, then those that need the servers to
/// be updated first as warnings, then the compatible ones, a line each.
[[nodiscard]] std::string render(const std::vector<Change>& changes);

}  // namespace rtpm::schema
