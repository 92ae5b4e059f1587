// Part of webcam.c: transfers over the wire, and the stream of pictures in them.

static int line = -1, port = -1;
static struct wanted {
    uint32_t seqnum;
    int length, packet_count;
    struct packet packets[PACKETS];
} wanted[64];
static int wanted_count;

static void unplugged(const char *why);

static bool send_all(const void *bytes, size_t count) {
    const char *at = bytes;
    while (count) {
        ssize_t sent = send(line, at, count, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return unplugged("the kernel hung up"), false;
        at += sent, count -= sent;
    }
    return true;
}
// What came in and was not looked at: several requests come in one read.
static uint8_t incoming[8192];
static size_t incoming_at, incoming_end;
static bool receive_all(void *bytes, size_t count) {
    uint8_t *at = bytes;
    while (count) {
        if (incoming_at == incoming_end) {
            ssize_t got = recv(line, incoming, sizeof incoming, 0);
            if (got < 0 && errno == EINTR) continue;
            if (got <= 0) return unplugged("the kernel hung up"), false;
            incoming_at = 0, incoming_end = got;
        }
        size_t one = incoming_end - incoming_at < count ? incoming_end - incoming_at : count;
        memcpy(at, incoming + incoming_at, one);
        at += one, count -= one, incoming_at += one;
    }
    return true;
}
// Completes a transfer; in one write, with what it brings: the bytes, and of an isochronous one its packets, of which `errors`
// failed.
static uint32_t microframe;
static void answer(struct wanted *w, int status, const void *data, int length, int actual, int errors) {
    static uint8_t *buffer;
    size_t packets = w->packet_count * sizeof *w->packets;
    buffer = realloc(buffer, sizeof(struct header) + length + packets);
    struct header h = {.command = htobe32(RET_SUBMIT), .seqnum = htobe32(w->seqnum)};
    h.u.ret.status = htobe32(status);
    h.u.ret.length = htobe32(actual);
    h.u.ret.start_frame = htobe32(microframe);
    h.u.ret.packets = htobe32(w->packet_count ? w->packet_count : -1);
    h.u.ret.errors = htobe32(errors);
    memcpy(buffer, &h, sizeof h);
    if (length) memcpy(buffer + sizeof h, data, length);
    memcpy(buffer + sizeof h + length, w->packets, packets);
    microframe += w->packet_count;
    send_all(buffer, sizeof h + length + packets);
}
static void complete(uint32_t seqnum, int status, const void *data, int length, int actual) {
    struct wanted w = {.seqnum = seqnum};
    answer(&w, status, data, length, actual, 0);
}

static void receive(void) {
    struct header h;
    if (!receive_all(&h, sizeof h)) return;
    uint32_t seqnum = be32toh(h.seqnum), ep = be32toh(h.ep);
    bool in = be32toh(h.direction) == 1;
    if (be32toh(h.command) == CMD_UNLINK) {
        uint32_t target = be32toh(h.u.unlink.seqnum);
        int status = 0;
        for (int i = 0; i < wanted_count; i++)
            if (wanted[i].seqnum == target) {
                memmove(wanted + i, wanted + i + 1, (--wanted_count - i) * sizeof *wanted);
                status = -ECONNRESET;
                break;
            }
        if (verbose) say("unlink %u: %d", target, status);
        struct header done = {.command = htobe32(RET_UNLINK), .seqnum = htobe32(seqnum)};
        done.u.ret.status = htobe32(status);
        send_all(&done, sizeof done);
        return;
    }
    int length = be32toh(h.u.submit.length);
    if (ep == STREAM_EP && in) {
        int packets = isochronous ? (int)be32toh(h.u.submit.packets) : 0;
        if (wanted_count == 64 || packets > PACKETS) return unplugged("too much is asked of it");
        struct wanted *w = &wanted[wanted_count];
        *w = (struct wanted){.seqnum = seqnum, .length = length, .packet_count = packets};
        if (receive_all(w->packets, packets * sizeof *w->packets)) wanted_count++;
        return;
    }
    static uint8_t data[65536 + 1024];
    memset(data, 0, 1024);
    if (length > 65536) length = 65536;
    if (!in && length && !receive_all(data, length)) return;
    if (ep != 0) return complete(seqnum, -EPIPE, NULL, 0, 0);
    int result = control_request(h.u.submit.setup, data, length);
    if (verbose) {
        uint8_t *s = h.u.submit.setup;
        say("control %02x %02x value %02x%02x index %02x%02x length %d: %d", s[0], s[1], s[3], s[2], s[5], s[4], length, result);
    }
    if (line < 0) return;
    if (result < 0) complete(seqnum, result, NULL, 0, 0);
    else if (in) {
        if (result > length) result = length;
        complete(seqnum, 0, data, result, result);
    } else complete(seqnum, 0, NULL, 0, length);
}

// --------------------------------------------------------------------------------------------------------- the stream

static bool streaming, halted, held;
static long number, sent_pictures, skipped, since_plug;
static uint8_t frame_bit;
static double due, first_picture = -1, period;
static struct picture picture;
static size_t picture_at;
static bool in_picture;
static uint32_t picture_pts;
static bool picture_err, to_lose;

static void start_stream(void) {
    struct format *f = &formats[committed.format - 1];
    struct size s = f->sizes[committed.frame - 1];
    period = committed.interval * 1e-7;
    say("stream %s %dx%d at %.2f", KIND_NAMES[f->kind], s.width, s.height, 1 / period);
    streaming = true, halted = false, in_picture = false;
    number = sent_pictures = skipped = 0;
    due = now() + period;
}
static void stop_stream(const char *why) {
    if (streaming) say("stream over (%s): %ld pictures sent, %ld skipped as nobody took them", why, sent_pictures, skipped);
    streaming = in_picture = halted = false;
}
static bool every(long n) { return n > 0 && number % n == n - 1; }

static void begin_picture(void) {
    struct format *f = &formats[committed.format - 1];
    struct size s = f->sizes[committed.frame - 1];
    static struct picture made;
    if (f->kind != MJPEG) {
        (f->kind == YUYV ? generate_yuyv : f->kind == NV12 ? generate_nv12 : generate_h264)(&made, s.width, s.height, number);
        picture = made;
    } else {
        if (every(stray) && f->count > 1) s = f->sizes[committed.frame % f->count];
        size_t fitting = 0, wanted_one, i;
        for (i = 0; i < picture_count; i++) fitting += pictures[i].width == s.width && pictures[i].height == s.height;
        if (fitting) {
            wanted_one = number % fitting;
            for (i = 0;; i++)
                if (pictures[i].width == s.width && pictures[i].height == s.height && wanted_one-- == 0) break;
            picture = pictures[i];
        } else {
            generate_jpeg(&made, s.width, s.height, number);
            picture = made;
        }
        if (padding) {
            static struct picture padded;
            padded.bytes = realloc(padded.bytes, picture.length + padding);
            memcpy(padded.bytes, picture.bytes, picture.length);
            memset(padded.bytes + picture.length, 0, padding);
            padded.length = picture.length + padding;
            picture = padded;
        }
    }
    if (every(hole) && picture.length > 4000) {
        static struct picture holed;
        holed.bytes = realloc(holed.bytes, picture.length);
        size_t half = picture.length / 2;
        memcpy(holed.bytes, picture.bytes, half);
        memcpy(holed.bytes + half, picture.bytes + half + 2000, picture.length - half - 2000);
        holed.length = picture.length - 2000;
        picture = holed;
    }
    if (every(cut)) picture.length /= 2;
    if (every(empty)) picture.length = 0;
    picture_err = every(err);
    to_lose = every(lose);
    picture_at = 0;
    picture_pts = (uint32_t)(uint64_t)(now() * CLOCK_HZ);
    in_picture = true;
    if (first_picture < 0) first_picture = now();
}

// Writes a payload's header and returns its length. Sets how many bytes of the picture belong to the payload, if that has at
// most `room` bytes.
static size_t begin_payload(uint8_t *to, size_t room, size_t *body) {
    size_t header = scr ? 12 : 6;
    *body = picture.length - picture_at;
    if (*body > room - header) *body = room - header;
    bool last = picture_at + *body == picture.length;
    uint8_t bits = 0x80 | 0x04 | frame_bit | (last && !no_eof ? 2 : 0) | (picture_err ? 0x40 : 0) | (scr ? 0x08 : 0);
    uint64_t t = (uint64_t)(now() * CLOCK_HZ);
    memcpy(to, (uint8_t[]){header, bits, L(picture_pts), L(t), W((uint64_t)(now() * 1000) & 0x7ff)}, header);
    return header;
}
// Writes the picture's next bytes, and ends the picture if they are the last.
static size_t copy_picture(uint8_t *to, size_t body) {
    memcpy(to, picture.bytes + picture_at, body);
    picture_at += body;
    if (picture_at == picture.length) {
        in_picture = false;
        frame_bit ^= 1;
        number++, sent_pictures++, since_plug++;
    }
    return body;
}

// A bulk transfer: one payload for one transfer. (A payload may be larger than a transfer; then the transfers after the first
// have no header.)
static size_t payload_left;
static size_t fill_transfer(struct wanted *w, uint8_t *buffer) {
    size_t at = 0;
    if (payload_left == 0) at = begin_payload(buffer, payload_bytes(), &payload_left);
    size_t body = payload_left < w->length - at ? payload_left : w->length - at;
    payload_left -= body;
    return at + copy_picture(buffer + at, body);
}
// An isochronous transfer: one payload in each packet. After the picture they are empty. Sets how many were lost.
static size_t fill_packets(struct wanted *w, uint8_t *buffer, int *lost) {
    size_t at = 0;
    for (int i = 0; i < w->packet_count; i++) {
        struct packet *p = &w->packets[i];
        size_t length = 0, body;
        if (in_picture) {
            length = begin_payload(buffer + at, be32toh(p->length), &body);
            length += copy_picture(buffer + at + length, body);
        }
        bool is_lost = in_picture && to_lose && picture_at > picture.length / 2;
        if (is_lost) length = 0, to_lose = false, ++*lost;
        p->actual_length = htobe32(length);
        p->status = htobe32(is_lost ? -EXDEV : 0);
        at += length;
    }
    return at;
}
static void fill(void) {
    struct wanted w = wanted[0];
    memmove(wanted, wanted + 1, --wanted_count * sizeof *wanted);
    static uint8_t *buffer;
    buffer = realloc(buffer, w.length);
    int lost = 0;
    size_t length = w.packet_count ? fill_packets(&w, buffer, &lost) : fill_transfer(&w, buffer);
    answer(&w, 0, buffer, length, length, lost);
}

// Sends what is due. Returns the seconds until there is more to do, or a negative number: nothing.
static double work(void) {
    double t = now(), since = first_picture < 0 ? -1 : t - first_picture;
    if (!streaming || line < 0) return -1;
    bool stalled = held || (stall >= 0 && since >= stall && (stall_for < 0 || since < stall + stall_for));
    if (halt >= 0 && since >= halt) halted = true, halt = -1, say("the endpoint fails");
    if (halted) {
        while (wanted_count && line >= 0) {
            answer(&wanted[0], -EPIPE, NULL, 0, 0, 0);
            memmove(wanted, wanted + 1, --wanted_count * sizeof *wanted);
        }
        return -1;
    }
    // Stalls within a picture, as a cable does.
    if (stalled && (!in_picture || picture_at > picture.length / 2)) return due = t + period, 0.01;
    if (!in_picture) {
        if (t < due) return due - t;
        while (due + period <= t) due += period, skipped++, number++;
        due += period;
        if (every(drop)) return number++, 0;
        begin_picture();
    }
    while (in_picture && wanted_count && line >= 0) {
        if (stalled && picture_at > picture.length / 2) break;
        fill();
    }
    return in_picture ? -1 : due - now();
}
