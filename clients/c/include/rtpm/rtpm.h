#pragma once

/*
 * RTPM from C, and from any language that calls C: devices, calls by name, events, recordings.
 *
 * This is RTPM's only promise of binary compatibility: functions are added, and fields behind the
 * last one of a struct, but none is changed or removed within a major version of the library.
 *
 * Threads: a handle may be used by several threads at a time, but closed by one, when no other uses
 * it. Functions never throw, and never end the process.
 *
 * Errors: a function returns RTPM_OK or why it did nothing else; rtpm_last_error() is that in words,
 * of the calling thread's last function. Texts are UTF-8. Times are in microseconds unless their
 * names say otherwise; quantities are in SI units in the device's own frame: x to the right, y up, z
 * towards the operator.
 *
 * A struct whose first field is struct_size is initialized by its macro RTPM_..._INIT, so that
 * programs work with later libraries.
 */
#include <stddef.h>
#include <stdint.h>

#define RTPM_API __attribute__((visibility("default")))

#ifdef __cplusplus
extern "C" {
#endif

/* What became of a call. */
typedef int32_t rtpm_status;
enum {
  RTPM_OK = 0,
  RTPM_INVALID = 1,     /* An argument is NULL, malformed or out of range: correct the program. */
  RTPM_UNREACHABLE = 2, /* No server answers, or the name is not bound: start it, or wait. */
  RTPM_TIMEOUT = 3,     /* No answer in time; it may have run. */
  RTPM_REFUSED = 4,     /* The server or device refused, and did nothing: the text says why. */
  RTPM_FAILED = 5,      /* It failed, and may have run: the text says why. */
  RTPM_NOT_HOLDER = 6,  /* This client does not hold the lease: acquire it. */
  RTPM_HELD = 7,        /* Another client holds the lease: wait, or take it over. */
  RTPM_STOPPED = 8,     /* An emergency stop is in force: remove its cause, then rearm. */
  RTPM_NOT_ACTIVE = 9,  /* The device is not active: activate it, or wait until it is back. */
  RTPM_NOTHING = 10,    /* There is no event or sample yet: try again. */
  RTPM_ENDED = 11,      /* The subscription has ended for good: open another. */
  RTPM_NO_MEMORY = 12
};

/* The library's version, major << 16 | minor << 8 | patch. */
RTPM_API uint32_t rtpm_version(void);
/* Why the calling thread's last function failed, with a remedy; "" if it did not. Valid until its
 * next function. */
RTPM_API const char* rtpm_last_error(void);
/* "refused"; "unknown" for another number. */
RTPM_API const char* rtpm_status_name(rtpm_status status);
/* Frees a text or memory that a function returned; NULL is allowed. */
RTPM_API void rtpm_free(void* memory);

/* ---- the program's side of all calls ---------------------------------------------------------- */

typedef struct rtpm_node rtpm_node;

typedef struct rtpm_node_options {
  uint32_t struct_size;
  /* "auto", "udp", "tcp" or "shm"; NULL: auto, shared memory on one host and else UDP. */
  const char* transport;
  /* URLs of registries with commas between; NULL: those of RTPM_REGISTRY, else this host's. */
  const char* registry;
  /* The program's private key, as `rtpm key` makes it: sessions are sealed; NULL: RTPM_KEY's, or
   * that of the user. */
  const char* key_file;
  /* The servers' keys; NULL: RTPM_KNOWN_SERVERS, or the file of the user. */
  const char* known_servers_file;
} rtpm_node_options;
#define RTPM_NODE_OPTIONS_INIT \
  { sizeof(rtpm_node_options), NULL, NULL, NULL, NULL }

/* Makes a node; without options if NULL. It connects when something is opened.
 * RTPM_INVALID: the transport is unknown. */
RTPM_API rtpm_status rtpm_node_open(const rtpm_node_options* options, rtpm_node** node);
/* Close everything that was opened with the node before. NULL is allowed. */
RTPM_API void rtpm_node_close(rtpm_node* node);
/* The names at and below a directory, or all if it is NULL, as JSON:
 * [{"name":"lab/arm0","interface":"rtpm.device.Device","url":"rtpm://..."}]. Free it by rtpm_free().
 * RTPM_UNREACHABLE: no registry answers. */
RTPM_API rtpm_status rtpm_node_names(rtpm_node* node, const char* directory, char** json);

/* ---- devices ---------------------------------------------------------------------------------- */

typedef struct rtpm_device rtpm_device;

#define RTPM_JOINT_COUNT_MAX 8
#define RTPM_OUTPUT_COUNT_MAX 8
#define RTPM_ANALOG_COUNT_MAX 8
#define RTPM_BUTTON_COUNT_MAX 16

typedef struct rtpm_device_options {
  uint32_t struct_size;
  /* 0 to 32767, the priority of its calls; below 0: the server's. */
  int32_t priority;
  /* How long a command acts without a newer one, 1000 to 1000000; then the force falls to zero. */
  int64_t hold_us;
  /* How long to wait for a device that is not there yet. */
  int64_t patience_us;
  /* The time that reads and commands have; 0: the schema's 10 ms, which is for loops. */
  int64_t timeout_us;
} rtpm_device_options;
#define RTPM_DEVICE_OPTIONS_INIT \
  { sizeof(rtpm_device_options), -1, 10000, 0, 0 }

typedef struct rtpm_description {
  uint32_t struct_size;
  char model[64]; /* The beginning of longer ones. */
  char serial[64];
  char frame[64];
  double rate_hz;
  double force_newton_max; /* 0: it has no force. */
  double torque_newton_metre_max;
  uint32_t joint_count;
  uint32_t output_count;
  uint32_t analog_count;
  uint32_t button_count;
  /* How long after the last command its force is zero, including its period. */
  int64_t force_end_us;
} rtpm_description;
#define RTPM_DESCRIPTION_INIT \
  { sizeof(rtpm_description), "", "", "", 0, 0, 0, 0, 0, 0, 0, 0 }

/* All values of a device in one cycle. */
typedef struct rtpm_sample {
  uint32_t struct_size;
  uint32_t buttons; /* Bit i is set while button i is pressed. */
  uint64_t sequence;
  int64_t host_time_ns; /* Of the measurement, on the monotonic clock of the device's host. */
  double position_m[3];
  double orientation[4]; /* A unit quaternion: x, y, z, w. */
  double linear_m_per_s[3];
  double angular_rad_per_s[3];
  double force_newton[3]; /* What the actuators apply. */
  double torque_newton_metre[3];
  double joints[RTPM_JOINT_COUNT_MAX];
  double joint_velocities[RTPM_JOINT_COUNT_MAX];
  double efforts[RTPM_JOINT_COUNT_MAX];
  float outputs[RTPM_OUTPUT_COUNT_MAX];
  float analogs[RTPM_ANALOG_COUNT_MAX];
  uint16_t button_edges[RTPM_BUTTON_COUNT_MAX]; /* Presses and releases, modulo 65536. */
  uint32_t faults;                              /* Bits of RTPM_FAULT_... */
  uint32_t lifecycle; /* 0 unconfigured, 1 inactive, 2 active, 3 fault, 4 finalized. */
} rtpm_sample;
#define RTPM_SAMPLE_INIT \
  { sizeof(rtpm_sample), 0, 0, 0, {0}, {0}, {0}, {0}, {0}, {0}, {0}, {0}, {0}, {0}, {0}, {0}, 0, 0 }

enum {
  RTPM_FAULT_DEVICE_GONE = 1 << 2,
  RTPM_FAULT_NOT_FINITE = 1 << 8,     /* Latched: no force until rtpm_device_recover(). */
  RTPM_FAULT_COMMAND_LOST = 1 << 9,   /* No live command: the force went to zero. */
  RTPM_FAULT_FORCE_CLAMPED = 1 << 10, /* The command was above the limit. */
  RTPM_FAULT_FORCE_RATE_LIMITED = 1 << 11,
  RTPM_FAULT_SOFT_START = 1 << 12, /* The force is rising to the command. */
  RTPM_FAULT_EMERGENCY_STOP = 1 << 13,
  RTPM_FAULT_TOO_FAST = 1 << 14 /* Latched: no force until rtpm_device_recover(). */
};

/* What joints are told. */
enum { RTPM_JOINT_POSITION = 4, RTPM_JOINT_VELOCITY = 5, RTPM_JOINT_EFFORT = 6 };

/* Opens a device by its name, such as "lab/arm0", or its URL, and follows the name. */
RTPM_API rtpm_status rtpm_device_open(rtpm_node* node, const char* name,
                                      const rtpm_device_options* options, rtpm_device** device);
/* Releases the lease, if it is held. NULL is allowed. */
RTPM_API void rtpm_device_close(rtpm_device* device);
/* As it was when the device was opened. */
RTPM_API rtpm_status rtpm_device_describe(rtpm_device* device, rtpm_description* description);
/* The newest sample. RTPM_NOTHING: there is none yet. */
RTPM_API rtpm_status rtpm_device_read(rtpm_device* device, rtpm_sample* sample);

/* Acquires the right to command the device; waits at most so long while another client has it.
 * Commands keep it; without any it ends after 10 s, and after 1 s of silence. RTPM_HELD. */
RTPM_API rtpm_status rtpm_device_acquire(rtpm_device* device, int64_t patience_us);
/* Takes the lease from its holder, whose force goes to zero, with the operator's priority.
 * RTPM_REFUSED: it was taken over within the last second. */
RTPM_API rtpm_status rtpm_device_take_over(rtpm_device* device);
/* Keeps the lease without a command. RTPM_NOT_HOLDER: the text says why it ended. */
RTPM_API rtpm_status rtpm_device_renew(rtpm_device* device);
/* Releases the lease; the force goes to zero. */
RTPM_API rtpm_status rtpm_device_release(rtpm_device* device);

/* Sets force and torque until the next command or the end of hold_us; a NULL torque is zero. After
 * rtpm_device_acquire() the force rises by soft start, and what exceeds the device's limits is cut:
 * rtpm_sample.faults shows both. RTPM_NOT_HOLDER, RTPM_STOPPED, RTPM_NOT_ACTIVE. RTPM_INVALID: a NaN
 * or an infinity; later commands have no effect until rtpm_device_recover(), which only the bit
 * RTPM_FAULT_NOT_FINITE shows. */
RTPM_API rtpm_status rtpm_device_set_wrench(rtpm_device* device, const double force_newton[3],
                                            const double torque_newton_metre[3]);
/* Commands all joints in a mode RTPM_JOINT_...: positions in the units of the joints, velocities in
 * these per second, or efforts in newton or newton metre. */
RTPM_API rtpm_status rtpm_device_set_joints(rtpm_device* device, int32_t mode, const double* values,
                                            uint32_t count);
/* Sets the outputs; force and motion do not change. */
RTPM_API rtpm_status rtpm_device_set_outputs(rtpm_device* device, const float* values,
                                             uint32_t count);

/* These three need the lease, and return when a sample shows their effect, after at most 5 s. */
RTPM_API rtpm_status rtpm_device_activate(rtpm_device* device);
RTPM_API rtpm_status rtpm_device_deactivate(rtpm_device* device);
/* Clears a latched fault. */
RTPM_API rtpm_status rtpm_device_recover(rtpm_device* device);

/* Removes the force at once, and refuses commands until the device is rearmed. Needs no lease. */
RTPM_API rtpm_status rtpm_device_emergency_stop(rtpm_device* device);
/* Ends an emergency stop, and returns when a sample shows that; the force returns by soft start.
 * Needs the lease. */
RTPM_API rtpm_status rtpm_device_rearm(rtpm_device* device);

/* ---- any object, by the schema that its server publishes -------------------------------------- */

typedef struct rtpm_object rtpm_object;

/* Opens an object by its name or URL. */
RTPM_API rtpm_status rtpm_object_open(rtpm_node* node, const char* name, rtpm_object** object);
RTPM_API void rtpm_object_close(rtpm_object* object);
/* Calls a method with a request as JSON, "" for none, and gives the reply as JSON, to be freed by
 * rtpm_free(); "" for a oneway. A NULL reply drops it. timeout_us 0: as the schema says.
 * RTPM_INVALID: the request does not fit the schema; the text names line and field.
 * RTPM_REFUSED: a stream, which this interface does not offer. */
RTPM_API rtpm_status rtpm_object_call(rtpm_object* object, const char* method, const char* request,
                                      int64_t timeout_us, char** reply);
/* The same with the bytes of the wire, for programs with generated code. */
RTPM_API rtpm_status rtpm_object_call_bytes(rtpm_object* object, const char* method,
                                            const void* request, size_t request_size,
                                            int64_t timeout_us, void** reply, size_t* reply_size);

/* ---- events ----------------------------------------------------------------------------------- */

typedef struct rtpm_events rtpm_events;

typedef struct rtpm_event {
  uint32_t struct_size;
  uint32_t type;
  uint32_t source;
  uint32_t is_replayed;  /* 1: it is older than the subscription. */
  uint64_t sequence;     /* Per supplier, type and source, from 1; 0: not counted. */
  int64_t origin_ns;     /* When it happened, on the monotonic clock of the hub's host. */
  const char* type_name; /* "lab.Touched"; "" if the hub does not know the type. */
  const char* json;      /* Its payload; "" if the hub does not know the type. */
  const void* payload;
  size_t payload_size;
  uint64_t lost_count; /* Events that were lost since rtpm_events_open(), on the way or here. */
} rtpm_event;
#define RTPM_EVENT_INIT \
  { sizeof(rtpm_event), 0, 0, 0, 0, 0, NULL, NULL, NULL, 0, 0 }

/* Subscribes to a hub, NULL: rtpm/events, with a filter as `rtpm echo --filter` takes it, NULL: all
 * events. At most `capacity` (1 to 65536) events and 64 MiB wait for the program; of further ones the
 * oldest are lost. It subscribes again by itself when the hub restarts.
 * RTPM_INVALID: the filter; the text shows the place. */
RTPM_API rtpm_status rtpm_events_open(rtpm_node* node, const char* hub, const char* filter,
                                      uint32_t capacity, rtpm_events** events);
RTPM_API void rtpm_events_close(rtpm_events* events);
/* A file descriptor that is readable while an event waits: for poll() and event loops, not to be read
 * or closed. */
RTPM_API int rtpm_events_descriptor(rtpm_events* events);
/* Takes the next event, and waits for it at most so long; its texts and payload are valid until the
 * next call. RTPM_NOTHING: none came. RTPM_ENDED. */
RTPM_API rtpm_status rtpm_events_next(rtpm_events* events, int64_t timeout_us, rtpm_event* event);

/* ---- recordings ------------------------------------------------------------------------------- */

typedef struct rtpm_recording rtpm_recording;

/* Records the events of a hub, NULL: rtpm/events, to a new file in MCAP, of these devices; all if
 * device_count is 0. RTPM_FAILED: the file exists, or can't be written. */
RTPM_API rtpm_status rtpm_recording_start(rtpm_node* node, const char* file, const char* hub,
                                          const char* const* devices, uint32_t device_count,
                                          rtpm_recording** recording);
/* Records a remark at the current time. */
RTPM_API rtpm_status rtpm_recording_annotate(rtpm_recording* recording, const char* text);
/* Ends the file and frees the handle, also where it fails. The counts may be NULL. */
RTPM_API rtpm_status rtpm_recording_stop(rtpm_recording* recording, uint64_t* message_count,
                                         uint64_t* lost_count);

#ifdef __cplusplus
}
#endif
