#pragma once

// Loading libraries under the names of POSIX, for tests.
extern "C" {
void* dlopen(const char* file, int flags);
void* dlsym(void* library, const char* name);
int dlclose(void* library);
const char* dlerror();
}
inline constexpr int RTLD_NOW = 2;
inline constexpr int RTLD_GLOBAL = 256;
