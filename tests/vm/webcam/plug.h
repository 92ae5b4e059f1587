// Part of webcam.c: the USB port that the camera is plugged into, and the node that the kernel makes of it.

static bool write_file(const char *path, const char *text) {
    int f = open(path, O_WRONLY);
    bool ok = f >= 0 && write(f, text, strlen(text)) == (ssize_t)strlen(text);
    int error = errno;
    if (f >= 0) close(f);
    errno = error;
    return ok;
}
static int free_port(void) {
    FILE *f = fopen(VHCI "status", "r");
    if (!f) die(VHCI "status (is vhci-hcd loaded?)");
    char text[256], hub[8];
    unsigned at, state;
    int found = -1;
    while (found < 0 && fgets(text, sizeof text, f))
        if (sscanf(text, "%7s %u %u", hub, &at, &state) == 3 && !strcmp(hub, "hs") && state == 4 && !(other_port && (int)at == port)) found = (int)at;
    fclose(f);
    return found;
}
// The video node that uvcvideo made: by the serial number, as there may be other cameras.
static bool read_line(const char *path, char *to, size_t room) {
    FILE *f = fopen(path, "r");
    bool ok = f && fgets(to, room, f);
    if (f) fclose(f);
    if (ok) to[strcspn(to, "\n")] = 0;
    return ok;
}
static bool find_node(char *to, size_t room) {
    for (int i = 0; i < 64; i++) {
        char path[128], text[128];
        snprintf(path, sizeof path, "/sys/class/video4linux/video%d/index", i);
        // The second node, index 1, is for metadata.
        if (!read_line(path, text, sizeof text) || strcmp(text, "0")) continue;
        snprintf(path, sizeof path, "/sys/class/video4linux/video%d/device/../serial", i);
        if (!read_line(path, text, sizeof text) || strcmp(text, serial)) continue;
        snprintf(to, room, "/dev/video%d", i);
        if (access(to, F_OK) == 0) return true;
    }
    return false;
}
static char node[32];
// Whether the kernel still has the device.
static bool is_attached(void) {
    glob_t found;
    bool attached = false;
    if (glob("/sys/bus/usb/devices/*/serial", 0, NULL, &found)) return false;
    for (size_t i = 0; i < found.gl_pathc; i++) {
        char text[128];
        attached |= read_line(found.gl_pathv[i], text, sizeof text) && !strcmp(text, serial);
    }
    globfree(&found);
    return attached;
}
static void plug(void) {
    if (line >= 0) return;
    // A port of vhci-hcd that is taken again while the kernel still ends the transfers of the last connection may hang.
    for (int i = 0; i < 1000 && is_attached(); i++) nanosleep(&(struct timespec){0, 5000000}, NULL);
    int pair[2];
    char text[64];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) die("socketpair");
    int room = 1 << 20;
    setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &room, sizeof room);
    if ((port = free_port()) < 0) errno = EBUSY, die("no free port");
    snprintf(text, sizeof text, "%d %d %d 3", port, pair[1], 0x00010002);
    if (!write_file(VHCI "attach", text)) die(VHCI "attach");
    close(pair[1]);
    line = pair[0];
    wanted_count = 0, payload_left = 0, frame_bit = 0, incoming_at = incoming_end = 0, since_plug = 0, first_picture = -1;
    forget();
    say("plugged into port %d", port);
}
// Has the kernel reset the device, which is what a program does to a camera that hangs. By a child, as the kernel then asks
// this camera for its descriptors.
static void reset(void) {
    char path[128], bus[8], device[8];
    snprintf(path, sizeof path, "/sys/class/video4linux/%s/device/../busnum", node + 5);
    bool known = read_line(path, bus, sizeof bus);
    snprintf(path, sizeof path, "/sys/class/video4linux/%s/device/../devnum", node + 5);
    if (!known || !read_line(path, device, sizeof device)) return say("reset: it has no node");
    if (fork()) return;
    snprintf(path, sizeof path, "/dev/bus/usb/%03d/%03d", atoi(bus), atoi(device));
    int f = open(path, O_WRONLY | O_CLOEXEC);
    if (f < 0 || ioctl(f, USBDEVFS_RESET)) die(path);
    _exit(0);
}
static double replug_at = -1;
static void unplugged(const char *why) {
    if (line < 0) return;
    stop_stream(why);
    close(line);
    line = -1;
    say("unplugged (%s) after %ld pictures", why, since_plug);
}
static void unplug(const char *why) {
    char text[16];
    if (line < 0) return;
    if (detach) {
        snprintf(text, sizeof text, "%d", port);
        if (!write_file(VHCI "detach", text)) say("detach: %s", strerror(errno));
    }
    unplugged(why);
    if (replug_after >= 0) replug_at = now() + replug_after;
}
