#include "cyclone/opaque_type.hpp"

#include <dds/ddsc/dds_public_qosdefs.h>
#include <dds/ddsi/q_radmin.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

namespace rtpm::ros2 {
namespace {

struct Type : ddsi_sertype {
  std::uint32_t size_max = 0;
};

struct Sample : ddsi_serdata {
  std::vector<std::byte> bytes{};  ///< Followed by zeros up to a multiple of 4.
  std::uint32_t size = 0;          ///< Without these.
};

Type* as_type(ddsi_sertype* type) {
  return static_cast<Type*>(type);
}
const Type* as_type(const ddsi_sertype* type) {
  return static_cast<const Type*>(type);
}
Sample* as_sample(ddsi_serdata* data) {
  return static_cast<Sample*>(data);
}
const Sample* as_sample(const ddsi_serdata* data) {
  return static_cast<const Sample*>(data);
}

std::unique_ptr<Sample> new_sample(const ddsi_sertype* type, ddsi_serdata_kind kind,
                                   std::size_t size) {
  auto sample = std::make_unique<Sample>();
  ddsi_serdata_init(sample.get(), type, kind);
  sample->size = static_cast<std::uint32_t>(size);
  sample->bytes.resize((size + 3) / 4 * 4);
  return sample;
}

// No type has a key, so all samples are of one instance.
bool has_same_key(const ddsi_serdata*, const ddsi_serdata*) {
  return true;
}

std::uint32_t size_of(const ddsi_serdata* data) {
  return as_sample(data)->size;
}

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind,
                             const nn_rdata* fragment, std::size_t size) {
  // Without a sample Cyclone DDS would write a line to standard error for each such message.
  if (size > as_type(type)->size_max) return new_sample(type, kind, 0).release();
  auto sample = new_sample(type, kind, size);
  std::uint32_t filled = 0;
  for (; fragment != nullptr; fragment = fragment->nextfrag) {
    if (fragment->maxp1 <= filled) continue;  // Fragments may overlap, but leave no gap.
    if (fragment->min > filled || fragment->maxp1 > size) return nullptr;
    const unsigned char* const payload =
        NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    std::memcpy(sample->bytes.data() + filled, payload + (filled - fragment->min),
                fragment->maxp1 - filled);
    filled = fragment->maxp1;
  }
  return filled == size ? sample.release() : nullptr;
}

ddsi_serdata* from_pieces(const ddsi_sertype* type, ddsi_serdata_kind kind,
                          ddsrt_msg_iovlen_t count, const ddsrt_iovec_t* pieces, std::size_t size) {
  if (size > as_type(type)->size_max) return new_sample(type, kind, 0).release();
  auto sample = new_sample(type, kind, size);
  std::size_t filled = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count; ++i) {
    const std::size_t part = std::min<std::size_t>(pieces[i].iov_len, size - filled);
    std::memcpy(sample->bytes.data() + filled, pieces[i].iov_base, part);
    filled += part;
  }
  return filled == size ? sample.release() : nullptr;
}

ddsi_serdata* from_key_hash(const ddsi_sertype* type, const ddsi_keyhash*) {
  return new_sample(type, SDK_KEY, 0).release();
}

// Samples are written by dds_writecdr() and read by dds_takecdr() only.
ddsi_serdata* from_structure(const ddsi_sertype*, ddsi_serdata_kind, const void*) {
  return nullptr;
}
bool to_structure(const ddsi_serdata*, void*, void**, void*) {
  return false;
}
bool key_to_structure(const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) {
  return true;
}

void copy_out(const ddsi_serdata* data, std::size_t offset, std::size_t size, void* to) {
  std::memcpy(to, as_sample(data)->bytes.data() + offset, size);
}

ddsi_serdata* lend(const ddsi_serdata* data, std::size_t offset, std::size_t size,
                   ddsrt_iovec_t* to) {
  ddsi_serdata* const shared = ddsi_serdata_ref(data);
  to->iov_base = as_sample(shared)->bytes.data() + offset;
  to->iov_len = size;
  return shared;
}
void take_back(ddsi_serdata* data, const ddsrt_iovec_t*) {
  ddsi_serdata_unref(data);
}

ddsi_serdata* without_type(const ddsi_serdata* data) {
  auto sample = new_sample(data->type, SDK_KEY, 0);
  sample->type = nullptr;
  return sample.release();
}

void free_sample(ddsi_serdata* data) {
  delete as_sample(data);
}

std::size_t print(const ddsi_sertype*, const ddsi_serdata*, char* to, std::size_t size) {
  if (size > 0) *to = '\0';
  return 0;
}

void key_hash(const ddsi_serdata*, ddsi_keyhash* to, bool) {
  *to = {};
}

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  delete as_type(type);
}
void zero_structures(const ddsi_sertype*, void*, std::size_t) {}
void realloc_structures(void**, const ddsi_sertype*, void*, std::size_t, std::size_t) {}
void free_structures(const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {}
bool is_same_type(const ddsi_sertype* a, const ddsi_sertype* b) {
  return as_type(a)->size_max == as_type(b)->size_max;
}
std::uint32_t hash_type(const ddsi_sertype* type) {
  return as_type(type)->size_max;
}

const ddsi_serdata_ops kSampleOperations{.eqkey = has_same_key,
                                         .get_size = size_of,
                                         .from_ser = from_fragments,
                                         .from_ser_iov = from_pieces,
                                         .from_keyhash = from_key_hash,
                                         .from_sample = from_structure,
                                         .to_ser = copy_out,
                                         .to_ser_ref = lend,
                                         .to_ser_unref = take_back,
                                         .to_sample = to_structure,
                                         .to_untyped = without_type,
                                         .untyped_to_sample = key_to_structure,
                                         .free = free_sample,
                                         .print = print,
                                         .get_keyhash = key_hash
#ifdef DDS_HAS_SHM
                                         ,
                                         .get_sample_size = nullptr,
                                         .from_iox_buffer = nullptr
#endif
};

// Without the operations for type information: a foreign one makes other vendors refuse to match.
const ddsi_sertype_ops kTypeOperations{.version = ddsi_sertype_v0,
                                       .arg = nullptr,
                                       .free = free_type,
                                       .zero_samples = zero_structures,
                                       .realloc_samples = realloc_structures,
                                       .free_samples = free_structures,
                                       .equal = is_same_type,
                                       .hash = hash_type,
                                       .type_id = nullptr,
                                       .type_map = nullptr,
                                       .type_info = nullptr,
                                       .derive_sertype = nullptr,
                                       .get_serialized_size = nullptr,
                                       .serialize_into = nullptr};

}  // namespace

ddsi_sertype* make_opaque_type(const std::string& name, std::uint32_t size_max) {
  auto type = std::make_unique<Type>();
  ddsi_sertype_init(type.get(), name.c_str(), &kTypeOperations, &kSampleOperations, true);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  type->size_max = size_max;
  return type.release();
}

ddsi_serdata* make_opaque_sample(const ddsi_sertype* type, ConstBytes cdr) {
  auto sample = new_sample(type, SDK_DATA, cdr.size());
  std::ranges::copy(cdr, sample->bytes.begin());
  return sample.release();
}

ConstBytes cdr_of(const ddsi_serdata* sample) noexcept {
  return ConstBytes(as_sample(sample)->bytes).first(as_sample(sample)->size);
}

}  // namespace rtpm::ros2
