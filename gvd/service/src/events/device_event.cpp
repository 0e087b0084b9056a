#include "rtpm/gvd/device_event.hpp"

namespace rtpm::gvd {
namespace {

events::Filter button_is(std::string_view device, std::size_t button, bool is_pressed) {
  using events::Comparison;
  using events::Scalar;
  return events::all_of(
      {events::of_type(kButtonChanged, source_of(device)),
       events::where(kButtonChanged, "button", Comparison::kEqual,
                     Scalar::of(static_cast<std::uint64_t>(button))),
       events::where(kButtonChanged, "is_pressed", Comparison::kEqual, Scalar::of(is_pressed))});
}

}  // namespace

events::Filter samples_of(std::string_view device) {
  return events::of_type(kSampled, source_of(device));
}

events::Filter changes_of(std::string_view device) {
  std::vector<events::Match> matches;
  for (const events::EventType type :
       {kButtonChanged, kContactChanged, kLifecycleChanged, kFaultChanged, kLeaseChanged,
        kStopChanged, kConfigurationChanged, kModelsRendered}) {
    matches.push_back(
        {type, events::kWholeNumber, source_of(device), events::kWholeNumber, /*hops_min=*/0});
  }
  return events::listed(std::move(matches));
}

events::Filter pressed(std::string_view device, std::size_t button) {
  return button_is(device, button, true);
}

events::Filter released(std::string_view device, std::size_t button) {
  return button_is(device, button, false);
}

}  // namespace rtpm::gvd
