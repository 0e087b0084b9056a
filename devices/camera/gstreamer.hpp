#pragma once

#include <gst/gst.h>

#include <memory>
#include <string>

namespace rtpm::camerad {

/// Releases GStreamer's and GLib's objects.
struct Unref {
  void operator()(GstElement* object) const noexcept { gst_object_unref(object); }
  void operator()(GstBus* object) const noexcept { gst_object_unref(object); }
  void operator()(GstClock* object) const noexcept { gst_object_unref(object); }
  void operator()(GstPad* object) const noexcept { gst_object_unref(object); }
  void operator()(GstMessage* message) const noexcept { gst_message_unref(message); }
  void operator()(GstQuery* query) const noexcept { gst_query_unref(query); }
  void operator()(GstCaps* caps) const noexcept { gst_caps_unref(caps); }
  void operator()(GstSample* sample) const noexcept { gst_sample_unref(sample); }
  void operator()(GstIterator* iterator) const noexcept { gst_iterator_free(iterator); }
  void operator()(GError* error) const noexcept { g_error_free(error); }
  void operator()(char* text) const noexcept { g_free(text); }
};
template <class T>
using Owned = std::unique_ptr<T, Unref>;

/// The text of a string that the caller owns; empty if it is null.
[[nodiscard]] inline std::string text_of(char* owned) {
  const Owned<char> text(owned);
  return text == nullptr ? std::string() : std::string(text.get());
}

}  // namespace rtpm::camerad
