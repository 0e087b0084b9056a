#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::names {

/// Result of an operation on names; wire numbers.
/// @source   OutcomeCode in schema/idl/names.fbs; the distinctions are CosNaming's
enum class Outcome : std::uint8_t {
  kDone = 0,
  kBadName = 1,               ///< A component is malformed, or the name is too long or deep.
  kNotFound = 2,              ///< Nothing is bound at the component or below it.
  kNotADirectory = 3,         ///< The component is itself a bound name.
  kIsADirectory = 4,          ///< Names are bound below it.
  kAlreadyBound = 5,          ///< Another owner holds the name until its lease ends.
  kStaleEpoch = 6,            ///< A later start of the same owner holds the name.
  kNotOwner = 7,              ///< Bound, but not by this start of this owner.
  kBadLease = 8,              ///< The lease is outside the limits.
  kBadUrl = 9,                ///< The URL is not of the form rtpm://host:port/path.
  kBadInterface = 10,         ///< The interface is not a qualified name such as lab.Arm.
  kBadOwner = 11,             ///< The owner is 0.
  kFull = 12,                 ///< The registry's limit of names is reached.
  kOwnerFull = 13,            ///< The owner's limit of names is reached.
  kHostFull = 14,             ///< The calling host's limit of names is reached.
  kHostOwnersFull = 15,       ///< The calling host's limit of owners is reached.
  kStaleRevision = 16,        ///< The holder is not the one with the given revision.
  kBadProperty = 17,          ///< A property is malformed, reserved, duplicate, or beyond a limit.
  kOwnerPropertiesFull = 18,  ///< The owner's limit of properties is reached.
  kPropertiesFull = 19,       ///< The registry's limit of properties is reached.
  kBadPredicate = 20,         ///< The text is not a predicate.
  kBadPreference = 21,        ///< The text is not a preference.
  kTooManyWatches = 22,       ///< The registry's or the host's limit of watches is reached.
  kReadOnly = 23,             ///< The registry's storage is damaged or gone: nothing changes.
  kStorageFull = 24,          ///< The registry's storage has no space left.
  kNotStored = 25,            ///< The registry's storage failed; nothing has changed.
  kDenied = 26,               ///< The registry's policy does not allow the caller to do this.
  kStoreUnreachable = 27,     ///< The registries' shared storage did not answer in time.
};

/// A clause for users: the offending component, the reason, and the remedy. `component` counts from
/// 0; for kBadProperty it is the property's index.
/// @realtime set-up only
[[nodiscard]] std::string outcome_text(Outcome outcome, std::string_view name,
                                       std::uint8_t component);

}  // namespace rtpm::names
