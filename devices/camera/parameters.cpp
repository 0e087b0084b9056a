#include "parameters.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <mutex>
#include <string_view>
#include <utility>

namespace rtpm::camerad {
namespace {

using driver::ParameterType;
using driver::ParameterValue;

constexpr std::array<const char*, 10> kProperties{
    "exposure", "exposure-time", "gain",       "iso",     "brightness",
    "contrast", "hue",           "saturation", "bitrate", "quality"};

std::string parameter_name(std::string_view element, std::string_view property) {
  std::string name = std::string(element) + "." + std::string(property);
  for (char& c : name) {
    const auto byte = static_cast<unsigned char>(c);
    c = c == '.' || std::isalnum(byte) != 0 ? static_cast<char>(std::tolower(byte)) : '_';
  }
  return name;
}

/// Fills in type and range; false if the property is no number.
bool set_range(const GParamSpec& property, driver::ParameterSpec& spec) {
  const auto set = [&spec](ParameterType type, auto low, auto high) {
    // Integers of a parameter are exact as doubles.
    constexpr double kWholeMax = 9007199254740992.0;
    spec.type = type;
    spec.low = std::max(static_cast<double>(low), -kWholeMax);
    spec.high = std::min(static_cast<double>(high), kWholeMax);
    return true;
  };
  const GParamSpec* const p = &property;
  if (G_IS_PARAM_SPEC_INT(p)) {
    const auto* const number = G_PARAM_SPEC_INT(p);
    return set(ParameterType::kInteger, number->minimum, number->maximum);
  }
  if (G_IS_PARAM_SPEC_UINT(p)) {
    const auto* const number = G_PARAM_SPEC_UINT(p);
    return set(ParameterType::kInteger, number->minimum, number->maximum);
  }
  if (G_IS_PARAM_SPEC_FLOAT(p)) {
    const auto* const number = G_PARAM_SPEC_FLOAT(p);
    return set(ParameterType::kReal, number->minimum, number->maximum);
  }
  if (G_IS_PARAM_SPEC_DOUBLE(p)) {
    const auto* const number = G_PARAM_SPEC_DOUBLE(p);
    return set(ParameterType::kReal, number->minimum, number->maximum);
  }
  return false;
}

ParameterValue read(GstElement& element, const char* property, ParameterType type) {
  if (type == ParameterType::kInteger) {
    GValue value = G_VALUE_INIT;
    g_value_init(&value, G_TYPE_INT64);
    g_object_get_property(G_OBJECT(&element), property, &value);
    return std::int64_t{g_value_get_int64(&value)};
  }
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_DOUBLE);
  g_object_get_property(G_OBJECT(&element), property, &value);
  return g_value_get_double(&value);
}

void write(GstElement& element, const char* property, const ParameterValue& wanted) {
  GValue value = G_VALUE_INIT;
  if (const auto* const whole = std::get_if<std::int64_t>(&wanted)) {
    g_value_init(&value, G_TYPE_INT64);
    g_value_set_int64(&value, *whole);
  } else {
    g_value_init(&value, G_TYPE_DOUBLE);
    g_value_set_double(&value, std::get<double>(wanted));
  }
  g_object_set_property(G_OBJECT(&element), property, &value);
}

/// Whether it is a source or an encoder.
bool has_parameters(GstElement& element) {
  GstElementFactory* const factory = gst_element_get_factory(&element);
  if (factory == nullptr) return false;
  const char* const words = gst_element_factory_get_metadata(factory, GST_ELEMENT_METADATA_KLASS);
  const std::string_view kind = words == nullptr ? "" : words;
  return kind.find("Source") != std::string_view::npos ||
         kind.find("Encoder") != std::string_view::npos;
}

}  // namespace

Parameters::Parameters(const Pipeline& pipeline, driver::Descriptor descriptor)
    : descriptor_(std::move(descriptor)) {
  const Owned<GstIterator> elements(gst_bin_iterate_recurse(&pipeline.bin()));
  GValue item = G_VALUE_INIT;
  while (gst_iterator_next(elements.get(), &item) == GST_ITERATOR_OK) {
    GstElement& element = *GST_ELEMENT(g_value_get_object(&item));
    if (has_parameters(element)) add(element);
    g_value_reset(&item);
  }
  g_value_unset(&item);
}

void Parameters::add(GstElement& element) {
  const std::string name = text_of(gst_object_get_name(GST_OBJECT(&element)));
  for (const char* const property : kProperties) {
    const GParamSpec* const found =
        g_object_class_find_property(G_OBJECT_GET_CLASS(&element), property);
    constexpr unsigned kBoth = G_PARAM_READWRITE;
    if (found == nullptr || (static_cast<unsigned>(found->flags) & kBoth) != kBoth) continue;
    Entry entry{.element = name, .property = property, .spec = {}};
    if (!set_range(*found, entry.spec)) continue;
    entry.spec.name = parameter_name(name, property);
    entry.spec.default_value = read(element, property, entry.spec.type);
    const char* const words = g_param_spec_get_blurb(const_cast<GParamSpec*>(found));
    entry.spec.description = words == nullptr ? "" : words;
    if (driver::fault_of(entry.spec).empty()) entries_.push_back(std::move(entry));
  }
}

std::vector<driver::ParameterSpec> Parameters::parameters() const {
  const std::lock_guard lock(mutex_);
  std::vector<driver::ParameterSpec> specs;
  for (const Entry& entry : entries_)
    specs.push_back(entry.spec);
  return specs;
}

void Parameters::use(const Pipeline* pipeline) {
  const std::lock_guard lock(mutex_);
  pipeline_ = pipeline;
  if (pipeline == nullptr) return;
  for (const Entry& entry : entries_) {
    const auto element = pipeline->element(entry.element);
    if (element != nullptr && entry.value) write(*element, entry.property.c_str(), *entry.value);
  }
}

expected<void, gvd::ConfigurationError> Parameters::apply(
    std::span<driver::ParameterSetting> settings, bool) {
  const std::lock_guard lock(mutex_);
  for (driver::ParameterSetting& setting : settings) {
    const auto entry = std::ranges::find_if(
        entries_, [&](const Entry& known) { return known.spec.name == setting.name; });
    if (entry == entries_.end()) continue;
    entry->value = setting.value;
    // Without a pipeline the value waits for the next one.
    const auto element = pipeline_ == nullptr ? nullptr : pipeline_->element(entry->element);
    if (element == nullptr) continue;
    write(*element, entry->property.c_str(), setting.value);
    setting.value = read(*element, entry->property.c_str(), entry->spec.type);
  }
  return {};
}

}  // namespace rtpm::camerad
