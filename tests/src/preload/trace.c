/* Appends to the file TRACE_FILE what the program does with regular files and folders below TRACE_FOLDER, each thing after it was
   done: a head, two paths and the bytes that were written. `workbench/endurance/src/power_cut/trace.rs` reads it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { CREATED = 1, WROTE, TRUNCATED, SYNCED, SYNCED_FOLDER, RENAMED, LINKED, UNLINKED };

struct head {
    uint32_t kind, path_len, other_len, reserved;
    uint64_t inode, offset, len;
};

static void say(struct head head, const char *path, const char *other, const void *bytes)
{
    const char *file = getenv("TRACE_FILE");
    if (file == NULL)
        return;
    int before = errno;
    head.path_len = path == NULL ? 0 : strlen(path);
    head.other_len = other == NULL ? 0 : strlen(other);
    struct iovec parts[4] = {
        {&head, sizeof head},
        {(void *)path, head.path_len},
        {(void *)other, head.other_len},
        {(void *)bytes, bytes == NULL ? 0 : head.len},
    };
    int fd = syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_APPEND | O_CLOEXEC, 0);
    size_t total = parts[0].iov_len + parts[1].iov_len + parts[2].iov_len + parts[3].iov_len;
    if (fd < 0 || syscall(SYS_writev, fd, parts, 4) != (long)total)
        abort();
    syscall(SYS_close, fd);
    errno = before;
}

static int is_watched(const char *path)
{
    const char *folder = getenv("TRACE_FOLDER");
    size_t len = folder == NULL ? 0 : strlen(folder);
    return len > 0 && strncmp(path, folder, len) == 0 && path[len] == '/';
}

/* Whether an open file is watched; its number and path. */
static int facts(int fd, struct stat *stat, char path[PATH_MAX])
{
    int before = errno;
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t len = -1;
    if (syscall(SYS_fstat, fd, stat) == 0 && (S_ISREG(stat->st_mode) || S_ISDIR(stat->st_mode)))
        len = readlink(link, path, PATH_MAX - 1);
    errno = before;
    if (len < 0)
        return 0;
    path[len] = 0;
    /* The folder itself, too. */
    const char *folder = getenv("TRACE_FOLDER");
    return is_watched(path) || (folder != NULL && strcmp(path, folder) == 0);
}

/* The path without links in its folder; 0 when it is not watched. */
static int resolve(int at, const char *path, char to[PATH_MAX])
{
    char copy[PATH_MAX], folder[PATH_MAX], whole[PATH_MAX];
    if (at != AT_FDCWD && path[0] != '/')
        return 0;
    if (strlen(path) >= sizeof copy)
        return 0;
    strcpy(copy, path);
    char *slash = strrchr(copy, '/');
    const char *name = slash == NULL ? path : path + (slash - copy) + 1;
    if (slash != NULL)
        slash[slash == copy ? 1 : 0] = 0;
    if (realpath(slash == NULL ? "." : copy, folder) == NULL)
        return 0;
    if (snprintf(whole, sizeof whole, "%s/%s", folder, name) >= (int)sizeof whole)
        return 0;
    strcpy(to, whole);
    return is_watched(to);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static void opened(int fd, int was_there, int flags)
{
    struct stat stat;
    char real[PATH_MAX];
    if (fd < 0 || !facts(fd, &stat, real) || !S_ISREG(stat.st_mode))
        return;
    struct head head = {.inode = stat.st_ino};
    if (!was_there)
        head.kind = CREATED;
    else if (flags & O_TRUNC)
        head.kind = TRUNCATED;
    else
        return;
    say(head, real, NULL, NULL);
}

static int exists(int at, const char *path)
{
    struct stat stat;
    int before = errno;
    int there = syscall(SYS_newfstatat, at, path, &stat, 0) == 0;
    errno = before;
    return there;
}

#define OPEN(name, at, ...)                                              \
    {                                                                    \
        mode_t mode = 0;                                                 \
        if (flags & (O_CREAT | __O_TMPFILE)) {                           \
            va_list more;                                                \
            va_start(more, flags);                                       \
            mode = va_arg(more, mode_t);                                 \
            va_end(more);                                                \
        }                                                                \
        int was_there = !(flags & O_CREAT) || exists(at, path);          \
        int fd = NEXT(name)(__VA_ARGS__);                                \
        opened(fd, was_there, flags);                                    \
        return fd;                                                       \
    }

int open(const char *path, int flags, ...) OPEN(open, AT_FDCWD, path, flags, mode)
int open64(const char *path, int flags, ...) OPEN(open64, AT_FDCWD, path, flags, mode)
int openat(int at, const char *path, int flags, ...) OPEN(openat, at, at, path, flags, mode)
int openat64(int at, const char *path, int flags, ...) OPEN(openat64, at, at, path, flags, mode)

static void wrote(int fd, const void *bytes, ssize_t done, off_t at)
{
    struct stat stat;
    char path[PATH_MAX];
    if (done <= 0 || !facts(fd, &stat, path))
        return;
    if (at < 0)
        at = syscall(SYS_lseek, fd, 0, SEEK_CUR) - done;
    say((struct head){.kind = WROTE, .inode = stat.st_ino, .offset = at, .len = done}, path, NULL, bytes);
}

ssize_t write(int fd, const void *bytes, size_t len)
{
    ssize_t done = NEXT(write)(fd, bytes, len);
    wrote(fd, bytes, done, -1);
    return done;
}

ssize_t writev(int fd, const struct iovec *parts, int count)
{
    ssize_t done = NEXT(writev)(fd, parts, count), left = done;
    struct stat stat;
    char path[PATH_MAX];
    if (done <= 0 || !facts(fd, &stat, path))
        return done;
    off_t at = syscall(SYS_lseek, fd, 0, SEEK_CUR) - done;
    for (int index = 0; index < count && left > 0; index++) {
        ssize_t len = (ssize_t)parts[index].iov_len < left ? (ssize_t)parts[index].iov_len : left;
        wrote(fd, parts[index].iov_base, len, at);
        at += len;
        left -= len;
    }
    return done;
}

ssize_t pwrite64(int fd, const void *bytes, size_t len, off64_t at)
{
    ssize_t done = NEXT(pwrite64)(fd, bytes, len, at);
    wrote(fd, bytes, done, at);
    return done;
}

ssize_t pwrite(int fd, const void *bytes, size_t len, off_t at)
{
    ssize_t done = NEXT(pwrite)(fd, bytes, len, at);
    wrote(fd, bytes, done, at);
    return done;
}

static int of_file(int kind, int fd, uint64_t len, int result)
{
    struct stat stat;
    char path[PATH_MAX];
    if (result != 0 || !facts(fd, &stat, path))
        return result;
    if (kind == SYNCED && S_ISDIR(stat.st_mode))
        kind = SYNCED_FOLDER;
    say((struct head){.kind = kind, .inode = stat.st_ino, .offset = len}, path, NULL, NULL);
    return result;
}

int ftruncate(int fd, off_t len) { return of_file(TRUNCATED, fd, len, NEXT(ftruncate)(fd, len)); }
int ftruncate64(int fd, off64_t len) { return of_file(TRUNCATED, fd, len, NEXT(ftruncate64)(fd, len)); }
int fsync(int fd) { return of_file(SYNCED, fd, 0, NEXT(fsync)(fd)); }
int fdatasync(int fd) { return of_file(SYNCED, fd, 0, NEXT(fdatasync)(fd)); }

static int of_names(int kind, int at, const char *from, int other_at, const char *to, int result)
{
    char path[PATH_MAX], other[PATH_MAX] = "";
    if (result == 0 && resolve(at, from, path) && (to == NULL || resolve(other_at, to, other)))
        say((struct head){.kind = kind}, path, to == NULL ? NULL : other, NULL);
    return result;
}

int rename(const char *from, const char *to)
{
    return of_names(RENAMED, AT_FDCWD, from, AT_FDCWD, to, NEXT(rename)(from, to));
}

int renameat2(int at, const char *from, int to_at, const char *to, unsigned flags)
{
    return of_names(RENAMED, at, from, to_at, to, NEXT(renameat2)(at, from, to_at, to, flags));
}

int link(const char *from, const char *to)
{
    return of_names(LINKED, AT_FDCWD, from, AT_FDCWD, to, NEXT(link)(from, to));
}

int linkat(int at, const char *from, int to_at, const char *to, int flags)
{
    return of_names(LINKED, at, from, to_at, to, NEXT(linkat)(at, from, to_at, to, flags));
}

int unlink(const char *path) { return of_names(UNLINKED, AT_FDCWD, path, 0, NULL, NEXT(unlink)(path)); }
int unlinkat(int at, const char *path, int flags)
{
    return of_names(UNLINKED, at, path, 0, NULL, NEXT(unlinkat)(at, path, flags));
}
