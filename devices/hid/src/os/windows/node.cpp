#include "node.hpp"

// Windows' own header first: the others build on it.
#include <windows.h>

extern "C" {  // MinGW-w64's header does not say so.
#include <hidsdi.h>
}

#include <memory>
#include <type_traits>

#include "preparsed_data.hpp"
#include "rtpm/base/utf8_path.hpp"
#include "rtpm/device_hid/report_descriptor.hpp"

namespace rtpm::device_hid {
namespace {

struct CloseFile {
  void operator()(HANDLE file) const noexcept { CloseHandle(file); }
};
using File = std::unique_ptr<std::remove_pointer_t<HANDLE>, CloseFile>;

struct FreeData {
  void operator()(PHIDP_PREPARSED_DATA data) const noexcept { HidD_FreePreparsedData(data); }
};
using PreparsedData = std::unique_ptr<std::remove_pointer_t<PHIDP_PREPARSED_DATA>, FreeData>;

/// The description of the collection at `node`, which needs no right to it; null if it is gone.
PreparsedData preparsed_data_of(const std::string& node) {
  const HANDLE opened =
      CreateFileW(path_of_utf8(node).c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE, nullptr,
                  OPEN_EXISTING, 0, nullptr);
  if (opened == INVALID_HANDLE_VALUE) return nullptr;
  const File file(opened);
  PHIDP_PREPARSED_DATA data = nullptr;
  return PreparsedData(HidD_GetPreparsedData(file.get(), &data) ? data : nullptr);
}

}  // namespace

/// Windows derives the node itself from the port, or from the serial number.
std::string port_of(const std::string&) {
  return {};
}

std::vector<std::byte> report_descriptor_of(const std::string& node) {
  const PreparsedData data = preparsed_data_of(node);
  HIDP_CAPS sizes{};
  if (!data || HidP_GetCaps(data.get(), &sizes) != HIDP_STATUS_SUCCESS) return {};
  // The call gives no size: it is in the header, if that is the known one.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): an opaque type
  const auto* const bytes = reinterpret_cast<const std::byte*>(data.get());
  const ConstBytes header(bytes, kPreparsedHeaderSize);
  return report_descriptor_from(ConstBytes(bytes, preparsed_size(header)));
}

ReportSizes report_sizes_of(const Unit& unit) {
  ReportSizes sizes;
  const PreparsedData data = preparsed_data_of(unit.node);
  HIDP_CAPS longest{};
  if (data && HidP_GetCaps(data.get(), &longest) == HIDP_STATUS_SUCCESS) {
    sizes.output_max = longest.OutputReportByteLength;
    sizes.feature_min = longest.FeatureReportByteLength;
  }
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  if (!descriptor) return sizes;
  sizes.inputs = descriptor->input_sizes;
  // Without numbers, the first byte may be any.
  if (!descriptor->has_report_ids) sizes.inputs.fill(descriptor->input_sizes[0]);
  return sizes;
}

}  // namespace rtpm::device_hid
