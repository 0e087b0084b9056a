#include "view.hpp"

#include <algorithm>
#include <vector>

#include "line.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::display {
namespace {

constexpr std::size_t kStateWidth = 8;

}  // namespace

void View::on_events(std::span<const gvd::DeviceEvent> events) {
  const std::lock_guard lock(mutex_);
  for (const gvd::DeviceEvent& event : events)
    see(event);
}

void View::on_notice(const events::Notice& notice) {
  const std::lock_guard lock(mutex_);
  if (notice.kind == events::NoticeKind::kInterrupted) {
    if (!is_cut_off_) ++sight_.gap_count;
    is_cut_off_ = true;
  }
  if (notice.kind == events::NoticeKind::kResubscribed) is_cut_off_ = false;
}

void View::see(const gvd::DeviceEvent& event) {
  if (std::holds_alternative<gvd::Timeout>(event.what)) {
    is_silent_ = true;
  } else if (const auto* const sample = std::get_if<driver::Sample>(&event.what)) {
    see(*sample);
  } else if (const auto* const button = std::get_if<gvd::ButtonChange>(&event.what)) {
    if (button->is_pressed) ++sight_.press_count;
  } else if (const auto* const contact = std::get_if<gvd::ContactChange>(&event.what)) {
    is_touching_ = contact->is_touching;
    if (contact->is_touching) ++sight_.contact_count;
  } else if (std::holds_alternative<gvd::LeaseChange>(event.what)) {
    ++sight_.lease_count;
  } else {
    ++sight_.other_count;
  }
}

void View::see(const driver::Sample& sample) {
  is_silent_ = false;
  // A restarted server counts from one again.
  if (!newest_ || sample.sequence < first_cycle_) first_cycle_ = sample.sequence;
  ++sight_.sample_count;
  sight_.cycle_count = sample.sequence - first_cycle_ + 1;
  newest_ = sample;
  curve_.push_back(first_value(descriptor_, sample));
  if (curve_.size() > curve_size_) curve_.pop_front();
}

std::string View::state_text() const {
  if (is_cut_off_) return "no hub";
  if (is_silent_) return "silent";
  if (newest_->faults.has(driver::Fault::kEmergencyStop)) return "stopped";
  if (newest_->lifecycle != driver::Lifecycle::kActive) {
    return std::string(to_string(newest_->lifecycle));
  }
  return is_touching_ ? "touching" : "";
}

std::string View::line(std::size_t name_width, std::size_t width) const {
  const std::lock_guard lock(mutex_);
  const std::string name = fitted(printable(name_), name_width);
  if (!newest_) return fitted(name + "  nothing yet", width);
  const std::vector<double> curve(curve_.begin(), curve_.end());
  const std::string begin = name + " " + fitted(curve_text(curve), curve_size_) + " ";
  const std::size_t used = width_of(begin) + 1 + kStateWidth;
  return fitted(begin + fitted(values_text(descriptor_, *newest_), width - std::min(width, used)) +
                    " " + state_text(),
                width);
}

Sight View::sight() const {
  const std::lock_guard lock(mutex_);
  return sight_;
}

}  // namespace rtpm::display
