#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

/// Differences between two versions of a schema, and which programs built from them can still
/// communicate.
namespace rtpm::schema {

enum class ChangeKind : std::uint8_t {
  kServiceAdded,
  kServiceRemoved,
  kPriorityChanged,  ///< The service's priority model or priority changed.
  kMethodAdded,
  kMethodRemoved,
  kMethodRenamed,     ///< The same id has another name.
  kMethodRenumbered,  ///< The same name has another id.
  kPayloadReplaced,   ///< The request or reply is another table.
  kPayloadKind,       ///< The encoding changed between bare struct, FlatBuffer and nothing.
  kIdempotentAdded,
  kIdempotentRemoved,
  kMannerChanged,  ///< Whether the method is a oneway or a stream, or the oneway's level, changed.
  kDeferredChanged,
  kDeadlineChanged,
  kMaxSizeRaised,
  kMaxSizeLowered,
  kTypeAdded,
  kTypeRemoved,
  kTypeKind,      ///< The kind of type changed: for example, a table became a struct.
  kStructLayout,  ///< A struct's fields or their offsets changed.
  kEventAdded,
  kEventChanged,  ///< The event number changed or was removed.
  kFieldAdded,
  kFieldAddedRequired,
  kFieldRemoved,
  kFieldMoved,  ///< The field moved to another slot.
  kFieldRenamed,
  kFieldRetyped,
  kFieldDefault,
  kFieldRequired,
  kFieldNotRequired,
  kFieldDeprecated,
  kFieldUndeprecated,
  kFieldKey,
  kFieldEncoding,  ///< `nested_flatbuffer`, `flexbuffer` or `force_align` changed.
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

/// The name of a change, such as "field-added" for kFieldAdded.
[[nodiscard]] std::string_view name_of(ChangeKind kind) noexcept;

/// The effect of a change on readers of data.
struct Reading {
  bool new_reads_old = true;  ///< A newer reader understands an older writer's data.
  bool old_reads_new = true;  ///< An older reader understands a newer writer's data.
  /// In a failing direction, the bytes still pass verification, but with a different meaning.
  bool is_by_meaning = false;
};

enum class Verdict : std::uint8_t {
  kCompatible,    ///< Every combination of old and new works.
  kServersFirst,  ///< Old clients work with new servers, but new clients fail with old servers.
  kIncompatible,  ///< Old clients fail with new servers, or a type used outside calls breaks.
};

struct Change {
  ChangeKind kind{};
  Verdict verdict = Verdict::kCompatible;
  bool breaks_old_clients = false;  ///< Old clients fail with a new server.
  bool breaks_new_clients = false;  ///< New clients fail with an old server.
  Reading reading{};                ///< The effect on readers of changed types.
  std::string owner{};              ///< The type or service, fully qualified.
  Diagnostic diagnostic{};          ///< Its hint tells how to avoid the change.
};

/// All changes from `before` to `after`, which may be models of different files.
///
/// Clients write requests and read replies; servers do the reverse. For an event, or a type of the
/// file that no method uses, a failure in either direction is incompatible.
[[nodiscard]] std::vector<Change> compare(const Model& before, const Model& after);

/// The changes as text: incompatible ones as errors, then "servers first" ones as warnings, then
/// compatible ones, one line each.
[[nodiscard]] std::string render(const std::vector<Change>& changes);

}  // namespace rtpm::schema
