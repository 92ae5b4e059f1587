// A USB webcam that is a program: it plugs itself into the kernel's vhci-hcd (USB over IP) through a pair of sockets, and
// answers like a USB Video Class camera with a bulk or an isochronous endpoint. Linux's own uvcvideo then makes /dev/videoN
// of it.
// Needs root, and the modules vhci-hcd and uvcvideo. `uvc_webcam --help` tells the rest.
#define _GNU_SOURCE
#include <dirent.h>
#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static const char USAGE[] =
    "uvc_webcam [OPTION...] [FILE.jpg|FOLDER...]: plugs in a webcam until SIGTERM, or until stdin says quit\n"
    "Pictures are sent in a loop, those of the size that was agreed on; without any, generated ones are.\n"
    "  --formats LIST           what the camera offers of mjpeg, yuyv, nv12 and h264 (which holds no picture), in this order\n"
    "                           (default: mjpeg:640x480:1280x720,yuyv:640x480);\n"
    "                           a width must be a multiple of 16 and at least 144, a height one of 8\n"
    "  --name TEXT --serial TEXT\n"
    "  --rates 30,15            frames per second\n"
    "  --isochronous            the endpoint is isochronous instead of bulk, with alternate settings for its bandwidth\n"
    "Misbehaviour, counted in pictures since the stream started or seconds since the first picture after plugging in:\n"
    "  --cut N                  every Nth picture ends after half of its bytes\n"
    "  --hole N                 every Nth picture lacks 2000 bytes in its middle, as after lost packets (end and size stay right)\n"
    "  --stray N                every Nth JPEG picture has the format's other size\n"
    "  --err N                  every Nth picture has the error bit in its payload headers\n"
    "  --lose N                 every Nth picture lacks a packet of an isochronous endpoint, and the kernel is told (EXDEV)\n"
    "  --drop N                 every Nth picture is not sent\n"
    "  --empty N                every Nth picture is a header without a byte\n"
    "  --no-eof                 the end of a picture is told by the frame bit (FID) alone\n"
    "  --no-dht                 pictures without Huffman tables, as many cameras send them\n"
    "  --padding N              N bytes of zero after each JPEG picture\n"
    "  --stall S [--stall-for T]  no more data after S seconds, for T seconds (default: for ever)\n"
    "  --halt S                 the endpoint fails (EPIPE) after S seconds\n"
    "  --unplug-after S [--replug-after T] [--unplug-times N]\n"
    "  --replug-formats LIST    what it offers after it was plugged in again\n"
    "  --other-port             it comes back at another port, as if put into another socket\n"
    "  --detach                 unplug by /sys/.../detach instead of by closing the socket\n"
    "  --busy                   refuse to start a stream: the commit request stalls\n"
    "  --bandwidth BYTES        of a microframe that other devices left: alternate settings beyond are refused (ENOSPC)\n"
    "  --scr                    source clock in the payload headers (vhci-hcd has no frame numbers to go with it)\n"
    "  --payload BYTES          at most in one payload, with header (default: 16384; isochronous: the rate's need)\n"
    "  --commands               read lines from stdin: unplug, plug, stall, go, halt, reset,\n"
    "                           cut|hole|stray|err|lose|drop|empty N, bandwidth BYTES, quit\n"
    "  --ready COMMAND ARG...   last: run this once the camera has its node, with UVC_WEBCAM=/dev/videoN; end with its exit code\n"
    "  --verbose                every control request\n";

enum { CMD_SUBMIT = 1, CMD_UNLINK, RET_SUBMIT, RET_UNLINK };
enum { SET_CUR = 0x01, GET_CUR = 0x81, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF };
enum { MJPEG, YUYV, NV12, H264, KINDS };
static const char *const KIND_NAMES[] = {"MJPEG", "YUYV", "NV12", "H264"}, *const GUIDS[] = {"", "YUY2", "NV12", "H264"};
#define VHCI "/sys/devices/platform/vhci_hcd.0/"
#define CLOCK_HZ 48000000u
#define STREAM_EP 1

struct header {
    uint32_t command, seqnum, devid, direction, ep;
    union {
        struct {
            uint32_t flags;
            int32_t length, start_frame, packets, interval;
            uint8_t setup[8];
        } submit;
        struct {
            int32_t status, length, start_frame, packets, errors;
        } ret;
        struct {
            uint32_t seqnum;
        } unlink;
        uint32_t words[7];
    } u;
};
_Static_assert(sizeof(struct header) == 48, "header");

// Settings.
static const char *name = "UVC Test Webcam", *serial = "TEST0001", *formats_text = "mjpeg:640x480:1280x720,yuyv:640x480", *replug_formats;
static int rates[8] = {30, 15}, rate_count = 2;
static long cut, hole, stray, err, lose, drop, empty, padding, payload_max, bandwidth = 3072, unplug_times = 1;
static bool isochronous, no_eof, no_dht, scr, busy, detach, other_port, commands, verbose;
static double stall = -1, stall_for = -1, halt = -1, unplug_after = -1, replug_after = -1;

// What the camera offers: sizes by format, in descriptor order.
struct size {
    int width, height;
};
static struct format {
    int kind, count;
    struct size sizes[4];
} formats[KINDS];
static int format_count;

struct picture {
    uint8_t *bytes;
    size_t length;
    int width, height;
};
static struct picture *pictures;
static size_t picture_count;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}
static void say(const char *text, ...) {
    va_list list;
    va_start(list, text);
    printf("uvc_webcam %.3f: ", now());
    vprintf(text, list);
    va_end(list);
    putchar('\n');
    fflush(stdout);
}
static void die(const char *text) {
    fprintf(stderr, "uvc_webcam: %s: %s\n", text, strerror(errno));
    exit(1);
}

#include "pictures.h"
#include "isochronous.h"
#include "requests.h"
#include "stream.h"
#include "plug.h"

static volatile sig_atomic_t over, child_over;
static void on_signal(int which) {
    if (which == SIGCHLD) child_over = 1;
    else over = 1;
}

static void obey(char *text) {
    char word[32] = "";
    long n = 0;
    sscanf(text, "%31s %ld", word, &n);
    if (!strcmp(word, "unplug")) unplug("as told");
    else if (!strcmp(word, "plug")) {
        if (replug_formats) choose_formats(replug_formats);
        plug();
    } else if (!strcmp(word, "stall")) held = true;
    else if (!strcmp(word, "go")) held = halted = false;
    else if (!strcmp(word, "halt")) halted = true;
    else if (!strcmp(word, "reset")) reset();
    else if (!strcmp(word, "cut")) cut = n;
    else if (!strcmp(word, "hole")) hole = n;
    else if (!strcmp(word, "stray")) stray = n;
    else if (!strcmp(word, "err")) err = n;
    else if (!strcmp(word, "lose")) lose = n;
    else if (!strcmp(word, "bandwidth")) bandwidth = n;
    else if (!strcmp(word, "drop")) drop = n;
    else if (!strcmp(word, "empty")) empty = n;
    else if (!strcmp(word, "quit")) over = 1;
    else if (*word) say("there is no command %s", word);
}

int main(int count, char **words) {
    char **run = NULL;
    for (int i = 1; i < count; i++) {
        char *w = words[i], *next = i + 1 < count ? words[i + 1] : NULL;
#define FLAG(text, variable) if (!strcmp(w, text)) { variable = true; continue; }
#define VALUE(text, expression) if (!strcmp(w, text)) { if (!next) { fputs(USAGE, stderr); return 2; } expression; i++; continue; }
        if (!strcmp(w, "--help")) return fputs(USAGE, stdout), 0;
        FLAG("--no-eof", no_eof) FLAG("--no-dht", no_dht) FLAG("--scr", scr) FLAG("--busy", busy) FLAG("--detach", detach)
        FLAG("--other-port", other_port) FLAG("--isochronous", isochronous)
        FLAG("--commands", commands) FLAG("--verbose", verbose)
        VALUE("--formats", formats_text = next) VALUE("--name", name = next) VALUE("--serial", serial = next)
        VALUE("--replug-formats", replug_formats = next)
        VALUE("--rates", rate_count = 0; for (char *r = strtok(next, ","); r && rate_count < 8; r = strtok(NULL, ",")) rates[rate_count++] = atoi(r))
        VALUE("--cut", cut = atol(next)) VALUE("--hole", hole = atol(next)) VALUE("--stray", stray = atol(next))
        VALUE("--err", err = atol(next)) VALUE("--drop", drop = atol(next)) VALUE("--lose", lose = atol(next))
        VALUE("--bandwidth", bandwidth = atol(next))
        VALUE("--empty", empty = atol(next)) VALUE("--padding", padding = atol(next)) VALUE("--payload", payload_max = atol(next))
        VALUE("--stall", stall = atof(next)) VALUE("--stall-for", stall_for = atof(next)) VALUE("--halt", halt = atof(next))
        VALUE("--unplug-after", unplug_after = atof(next)) VALUE("--replug-after", replug_after = atof(next))
        VALUE("--unplug-times", unplug_times = atol(next))
        if (!strcmp(w, "--ready")) {
            run = words + i + 1;
            break;
        }
        if (*w == '-') return fprintf(stderr, "uvc_webcam: there is no option %s\n%s", w, USAGE), 2;
        add(w);
    }
    choose_formats(formats_text);
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGCHLD, &action, NULL);
    plug();
    pid_t child = 0;
    int code = 0;
    while (!over) {
        double wait = work(), t = now();
        if (line >= 0 && unplug_after >= 0 && unplug_times > 0 && first_picture >= 0) {
            if (t >= first_picture + unplug_after) {
                unplug_times--;
                unplug("as planned");
                continue;
            }
            double left = first_picture + unplug_after - t;
            if (wait < 0 || left < wait) wait = left;
        }
        if (replug_at >= 0) {
            if (t >= replug_at) {
                replug_at = -1;
                if (replug_formats) choose_formats(replug_formats);
                plug();
                continue;
            }
            if (wait < 0 || replug_at - t < wait) wait = replug_at - t;
        }
        if (wait < 0 || wait > 0.1) wait = 0.1;
        struct pollfd files[2] = {{line, POLLIN, 0}, {commands ? 0 : -1, POLLIN, 0}};
        struct timespec pause = {0, (long)(wait * 1e9)};
        if (ppoll(files, 2, &pause, NULL) > 0) {
            if (files[0].revents) do receive();
                while (line >= 0 && incoming_at < incoming_end);
            if (files[1].revents) {
                static char text[256];
                static size_t length;
                ssize_t got = read(0, text + length, sizeof text - 1 - length);
                if (got <= 0) commands = false;
                else {
                    text[length += got] = 0;
                    char *end;
                    while ((end = strchr(text, '\n'))) {
                        *end = 0;
                        obey(text);
                        memmove(text, end + 1, (length -= end + 1 - text) + 1);
                    }
                }
            }
        }
        if (line >= 0 && !node_known && find_node(node, sizeof node)) {
            node_known = true;
            say("is %s", node);
            if (run && !child && !(child = fork())) {
                setenv("UVC_WEBCAM", node, 1);
                execvp(run[0], run);
                die(run[0]);
            }
        }
        if (child && child_over) {
            int status;
            if (waitpid(child, &status, WNOHANG) == child) {
                code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
                over = 1;
            }
        }
    }
    unplug("the end");
    return code;
}
