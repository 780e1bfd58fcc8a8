/* A computer whose clock is set and whose disk fills, for processes that preload this library.
 * Their clock is off by `step_ns`; files take `left_bytes` more, then no space is left (below 0: no limit).
 * Both stand in the file that SOILMOIST_UNRELIABLE names, which another process changes. Output is not limited. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static struct {
    _Atomic int64_t step_ns, left_bytes;
} *control;

static int (*real_gettime)(clockid_t, struct timespec *);
static ssize_t (*real_write)(int, const void *, size_t);
static int (*real_cond_wait)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
static int (*real_sem_wait)(sem_t *, const struct timespec *);

__attribute__((constructor)) static void begin(void)
{
    real_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    real_write = dlsym(RTLD_NEXT, "write");
    real_cond_wait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
    real_cond_wait = real_cond_wait != NULL ? real_cond_wait : dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    real_sem_wait = dlsym(RTLD_NEXT, "sem_timedwait");
    const char *name = getenv("SOILMOIST_UNRELIABLE");
    int file = name == NULL ? -1 : open(name, O_RDWR | O_CLOEXEC);
    if (file < 0)
        return;
    void *found = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (found != MAP_FAILED)
        control = found;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    int code = real_gettime(clock, now);
    if (code == 0 && control != NULL && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
        int64_t ns = now->tv_sec * 1000000000LL + now->tv_nsec + control->step_ns;
        now->tv_sec = ns / 1000000000LL;
        now->tv_nsec = ns % 1000000000LL;
    }
    return code;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone)
{
    struct timespec exact;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *kept)
{
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (kept != NULL)
        *kept = exact.tv_sec;
    return exact.tv_sec;
}

/* The kernel knows the true clock only. Times since 1970 are those of the clock that is off; steady time is short. */
static struct timespec true_time(const struct timespec *limit)
{
    struct timespec changed = *limit;
    if (control != NULL && limit->tv_sec > 1000000000LL) {
        int64_t ns = limit->tv_sec * 1000000000LL + limit->tv_nsec - control->step_ns;
        changed.tv_sec = ns / 1000000000LL;
        changed.tv_nsec = ns % 1000000000LL;
    }
    return changed;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *limit)
{
    struct timespec changed = true_time(limit);
    return real_cond_wait(condition, mutex, &changed);
}

int sem_timedwait(sem_t *semaphore, const struct timespec *limit)
{
    struct timespec changed = true_time(limit);
    return real_sem_wait(semaphore, &changed);
}

ssize_t write(int file, const void *data, size_t size)
{
    struct stat kind;
    if (control == NULL || control->left_bytes < 0 || file <= 2 || fstat(file, &kind) != 0 || !S_ISREG(kind.st_mode))
        return real_write(file, data, size);
    int64_t left = control->left_bytes;
    if (left <= 0 && size > 0) {
        errno = ENOSPC;
        return -1;
    }
    ssize_t done = real_write(file, data, size < (size_t)left ? size : (size_t)left);
    if (done > 0)
        control->left_bytes -= done;
    return done;
}
