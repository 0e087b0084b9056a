#include "rtpm/viewers/pictures.hpp"

#include <CompressedImage_generated.h>
#include <CompressedVideo_generated.h>
#include <RawAudio_generated.h>

#include <span>

namespace rtpm::viewers {
namespace {

template <class T>
const T* table_in(ConstBytes message) noexcept {
  if (message.size() < sizeof(flatbuffers::uoffset_t)) return nullptr;
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(message.data());
  flatbuffers::Verifier verifier(bytes, message.size());
  return verifier.VerifyBuffer<T>(nullptr) ? flatbuffers::GetRoot<T>(bytes) : nullptr;
}

template <class T>
std::optional<ConstBytes> data_in(ConstBytes message) noexcept {
  const T* const table = table_in<T>(message);
  if (table == nullptr || table->data() == nullptr) return std::nullopt;
  return std::as_bytes(std::span(table->data()->data(), table->data()->size()));
}

}  // namespace

std::optional<ConstBytes> picture_in(Type type, ConstBytes message) noexcept {
  return type == Type::kCompressedImage ? data_in<foxglove::CompressedImage>(message)
                                        : data_in<foxglove::CompressedVideo>(message);
}

std::optional<Sound> sound_in(ConstBytes message) noexcept {
  const auto data = data_in<foxglove::RawAudio>(message);
  if (!data) return std::nullopt;
  const auto* const table = table_in<foxglove::RawAudio>(message);
  return Sound{*data, table->sample_rate(), table->number_of_channels()};
}

}  // namespace rtpm::viewers
