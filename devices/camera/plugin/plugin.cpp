// The GStreamer plug-in "rtpm".
#include "elements.hpp"

namespace rtpm::camerad {

void install_settings(GObjectClass& object_class) {
  const auto add = [&](unsigned id, const char* name, const char* words, const char* value) {
    g_object_class_install_property(
        &object_class, id,
        g_param_spec_string(name, name, words, value,
                            static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS)));
  };
  add(kMedium, "medium", "The medium, by name or URL", "lab/cam0");
  add(kRegistry, "registry", "Where names are: the URL of a registry, or this host",
      std::string(names::kThisHost).c_str());
}

bool set_setting(Settings& settings, unsigned id, const GValue& value) {
  if (id != kMedium && id != kRegistry) return false;
  const char* const text = g_value_get_string(&value);
  (id == kMedium ? settings.medium : settings.registry) = text == nullptr ? "" : text;
  return true;
}

bool get_setting(const Settings& settings, unsigned id, GValue& value) {
  if (id != kMedium && id != kRegistry) return false;
  g_value_set_string(&value, (id == kMedium ? settings.medium : settings.registry).c_str());
  return true;
}

namespace {

gboolean init(GstPlugin* plugin) {
  return gst_element_register(plugin, "rtpmsrc", GST_RANK_NONE, source_type()) != FALSE &&
                 gst_element_register(plugin, "rtpmsink", GST_RANK_NONE, sink_type()) != FALSE
             ? TRUE
             : FALSE;
}

}  // namespace
}  // namespace rtpm::camerad

#define PACKAGE "rtpm"
GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, rtpm,
                  "Cameras and microphones of RTPM as source and sink", rtpm::camerad::init,
                  RTPM_VERSION, "Apache 2.0", "rtpm", "rtpm")
