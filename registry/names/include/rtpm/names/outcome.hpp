#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::names {

/// How an operation on names ended. The numbers are the wire's and never change.
/// @source   OutcomeCode in schema/idl/names.fbs; the distinctions are CosNaming's
enum class Outcome : std::uint8_t {
  kDone = 0,
  kBadName = 1,   ///< The component is malformed, or the name too long or deep. Choose another.
  kNotFound = 2,  ///< Nothing is bound at the component or below it. Check that its server runs.
  kNotADirectory = 3,  ///< The component is a bound name, so that nothing can be below it.
  kIsADirectory = 4,   ///< Names are bound below it, so that it can't be one itself.
  kAlreadyBound =
      5,            ///< Another owner holds the name. Choose another, or wait for its lease to end.
  kStaleEpoch = 6,  ///< A later start of the same owner holds the name. Leave it to that one.
  kNotOwner = 7,    ///< The name is bound, but not by this start of this owner. Bind it first.
  kBadLease = 8,    ///< The lease is outside the limits.
  kBadUrl = 9,      ///< The URL is not of the form rtpm://host:port/path.
  kBadInterface = 10,    ///< The interface is not a qualified name such as lab.Arm.
  kBadOwner = 11,        ///< The owner is 0.
  kFull = 12,            ///< The registry holds as many names as it may.
  kOwnerFull = 13,       ///< The owner holds as many names as it may.
  kHostFull = 14,        ///< The host that asks has bound as many names as one host may.
  kHostOwnersFull = 15,  ///< It has bound names for as many owners as one host may.
  kStaleRevision = 16,   ///< The holder is another one than the revision says. Look who it is.
};

/// The outcome of an operation on `name` as a clause for a person: what is wrong with which
/// component, and what to do. `component` counts from 0.
/// @realtime set-up only
[[nodiscard]] std::string outcome_text(Outcome outcome, std::string_view name,
                                       std::uint8_t component);

}  // namespace rtpm::names
