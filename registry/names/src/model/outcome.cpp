#include "rtpm/names/outcome.hpp"

#include "model/name.hpp"
#include "rtpm/names/property.hpp"

namespace rtpm::names {
namespace {

/// `name` up to and including the component `index`.
std::string_view up_to(std::string_view name, std::size_t index) {
  const std::string_view component = component_of(name, index);
  if (component.empty()) return name;
  return {name.begin(), component.end()};
}

std::string bad_name_text(std::string_view name, std::size_t index) {
  if (name.empty()) return "the name is empty: give one such as lab/arm0";
  const std::string which = "the name " + quoted(name);
  if (index >= kNameDepthMax) {
    return which + " has more than " + std::to_string(kNameDepthMax) + " components";
  }
  const std::string_view component = component_of(name, index);
  if (component.size() <= kComponentSizeMax && up_to(name, index).size() > kNameSizeMax) {
    return which + " is longer than " + std::to_string(kNameSizeMax) + " bytes";
  }
  return "component " + std::to_string(index + 1) + " of " + which + ", " + quoted(component) +
         ", is not 1 to " + std::to_string(kComponentSizeMax) + " letters, digits, '.', '_' or '-'";
}

std::string bad_property_text(const std::string& it, std::size_t index) {
  return "property " + std::to_string(index + 1) + " of " + it +
         " is not a name of letters, digits, '_' and '.' that predicates do not use, once there, "
         "with a finite number or at most " +
         std::to_string(kPropertyTextSizeMax) +
         " printable bytes, or is beyond the limits of a binding";
}

}  // namespace

std::string outcome_text(Outcome outcome, std::string_view name, std::uint8_t component) {
  const std::string it = "the name " + quoted(name);
  const std::string place = quoted(up_to(name, component));
  switch (outcome) {
    case Outcome::kDone:
      return it + " is done";
    case Outcome::kBadName:
      return bad_name_text(name, component);
    case Outcome::kNotFound:
      return it + " is not bound, nothing is at " + place +
             ": check the spelling, and that its server runs and has the same registry";
    case Outcome::kNotADirectory:
      return it + " can't be there, because " + place + " is itself bound: choose another name";
    case Outcome::kIsADirectory:
      return it + " is no object, because longer names are bound below it: name one of these";
    case Outcome::kAlreadyBound:
      return it + " is held by another server: choose another name, or end that server";
    case Outcome::kStaleEpoch:
      return it + " is held by a later start of this server: leave it to that one";
    case Outcome::kNotOwner:
      return it + " is held by another server: bind it first";
    case Outcome::kBadLease:
      return "the lease for " + it + " is outside the registry's limits, by default 100ms to 1h";
    case Outcome::kBadUrl:
      return "the URL for " + it + " is not rtpm://host:port/path of at most " +
             std::to_string(kUrlSizeMax) + " printable bytes";
    case Outcome::kBadInterface:
      return "the interface for " + it + " is not a qualified name such as lab.Arm of at most " +
             std::to_string(kInterfaceSizeMax) + " bytes";
    case Outcome::kBadOwner:
      return "the owner of " + it + " is 0: give it a number";
    case Outcome::kFull:
      return it + " finds the registry full: unbind others, or start another registry";
    case Outcome::kOwnerFull:
      return it + " is one more than the registry lets one server hold: unbind others";
    case Outcome::kHostFull:
      return it +
             " is one more than the registry lets one host hold: unbind others, or start "
             "rtpm-registryd with a larger --names-per-host-max";
    case Outcome::kHostOwnersFull:
      return it +
             " is of one more server than the registry lets one host have: end others, or start "
             "rtpm-registryd with a larger --servers-per-host-max";
    case Outcome::kStaleRevision:
      return it +
             " is held by another server than the one to be replaced: resolve the name and retry";
    case Outcome::kBadProperty:
      return bad_property_text(it, component);
    case Outcome::kOwnerPropertiesFull:
      return it + " has more properties than the registry has memory for of one server: drop some";
    case Outcome::kPropertiesFull:
      return it + " finds the registry's memory for properties full: drop some";
    case Outcome::kBadPredicate:
      return "the text is no predicate";
    case Outcome::kBadPreference:
      return "the text is no preference";
    case Outcome::kTooManyWatches:
      return "the registry has as many watches as it may: end others";
    case Outcome::kReadOnly:
      return it + " stays as it is, because the registry's database can't be changed: see its log";
    case Outcome::kStorageFull:
      return it + " was not changed, because the registry's disk is full: free some space there";
    case Outcome::kNotStored:
      return it + " was not changed, because the registry can't write its database: see its log";
    case Outcome::kDenied:
      return it +
             " is not for this caller, says the registry's policy: ask its operator, "
             "whose log says what would allow it";
    case Outcome::kStoreUnreachable:
      return it +
             " may have been changed or not, because the registry's storage did not answer: look "
             "at the name, and try again";
  }
  return it + " got the unknown outcome " + std::to_string(static_cast<int>(outcome)) +
         ": the registry is newer than this program";
}

}  // namespace rtpm::names
