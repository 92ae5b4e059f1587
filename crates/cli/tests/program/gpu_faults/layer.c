/* A Vulkan layer that injects GPU faults. FAULT is KIND:N; the Nth call of that kind and all later ones fail:
 *   submit     device loss at submission
 *   wait       device loss during a wait
 *   hang       work never completes: each wait lasts until its timeout
 *   memory     out of memory
 *   idle       work is skipped but reported as complete
 * Needs no Vulkan headers: the required declarations are repeated here, as in the specification. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SHOWN __attribute__((visibility("default")))
enum { SUCCESS = 0, TIMEOUT = 2, OUT_OF_DEVICE_MEMORY = -2, DEVICE_LOST = -4 };
enum { INSTANCE_LINK = 47, DEVICE_LINK = 48 };

typedef int32_t Result;
typedef void (*Function)(void);
typedef Function (*GetProc)(void *object, const char *name);

/* The loader's chain of layers (VkLayerInstanceCreateInfo, VkLayerDeviceCreateInfo). */
struct link {
    struct link *next;
    GetProc instance_proc, device_proc;
};
struct chain {
    int32_t type;
    struct chain *next;
    int32_t kind;
    struct link *link;
};
struct interface {
    int32_t type;
    void *next;
    uint32_t version;
    GetProc instance_proc, device_proc, physical_proc;
};

static GetProc next_of_instance, next_of_device;

/* Counts a call of this kind; whether it fails. */
static int strikes(const char *kind) {
    static int calls, struck;
    const char *fault = getenv("FAULT");
    size_t length = strlen(kind);
    if (!fault || strncmp(fault, kind, length) || fault[length] != ':')
        return 0;
    if (++calls >= atoi(fault + length + 1))
        struck = 1;
    return struck;
}

/* Whether any call has lost the device. */
static int lost;
static Result lose(void) {
    lost = 1;
    return DEVICE_LOST;
}

static Result (*submit)(void *, uint32_t, const void *, uint64_t);
static Result our_submit(void *queue, uint32_t count, const void *work, uint64_t fence) {
    return lost || strikes("submit") ? lose() : submit(queue, count, work, fence);
}

static Result (*submit2)(void *, uint32_t, const void *, uint64_t);
static Result our_submit2(void *queue, uint32_t count, const void *work, uint64_t fence) {
    return lost || strikes("submit") ? lose() : submit2(queue, count, work, fence);
}

static int hangs;
static Result hang(uint64_t timeout_ns) {
    hangs = 1;
    uint64_t left_us = timeout_ns / 1000;
    for (; left_us > 100000; left_us -= 100000)
        usleep(100000);
    usleep((useconds_t)left_us);
    return TIMEOUT;
}

/* The program polls with short timeouts, so only waits that succeed are counted. */
static Result waited(Result found, uint64_t timeout_ns) {
    if (found == TIMEOUT)
        return found;
    if (strikes("wait"))
        return lose();
    return strikes("hang") ? hang(timeout_ns) : found;
}

static Result (*wait_semaphores)(void *, const void *, uint64_t);
static Result our_wait_semaphores(void *device, const void *which, uint64_t timeout_ns) {
    if (lost)
        return lose();
    return hangs ? hang(timeout_ns) : waited(wait_semaphores(device, which, timeout_ns), timeout_ns);
}

static Result (*wait_fences)(void *, uint32_t, const uint64_t *, uint32_t, uint64_t);
static Result our_wait_fences(void *device, uint32_t count, const uint64_t *which, uint32_t all, uint64_t timeout_ns) {
    if (lost)
        return lose();
    return hangs ? hang(timeout_ns) : waited(wait_fences(device, count, which, all, timeout_ns), timeout_ns);
}

static Result (*counter)(void *, uint64_t, uint64_t *);
static Result our_counter(void *device, uint64_t semaphore, uint64_t *value) {
    static uint64_t done;
    if (lost)
        return DEVICE_LOST;
    if (!hangs) {
        Result result = counter(device, semaphore, value);
        done = *value;
        return result;
    }
    *value = done;
    return SUCCESS;
}

static Result (*idle)(void *);
static Result our_idle(void *device) {
    while (hangs)
        sleep(1);
    return lost ? DEVICE_LOST : idle(device);
}

static Result (*allocate)(void *, const void *, const void *, uint64_t *);
static Result our_allocate(void *device, const void *what, const void *allocator, uint64_t *memory) {
    return strikes("memory") ? OUT_OF_DEVICE_MEMORY : allocate(device, what, allocator, memory);
}

static void (*dispatch)(void *, uint32_t, uint32_t, uint32_t);
static void our_dispatch(void *commands, uint32_t x, uint32_t y, uint32_t z) {
    if (!strikes("idle"))
        dispatch(commands, x, y, z);
}

static Function of_device(void *device, const char *name) {
    const struct {
        const char *name;
        void *next;
        Function ours;
    } taken[] = {
        {"vkQueueSubmit", &submit, (Function)our_submit},
        {"vkQueueSubmit2", &submit2, (Function)our_submit2},
        {"vkQueueSubmit2KHR", &submit2, (Function)our_submit2},
        {"vkWaitSemaphores", &wait_semaphores, (Function)our_wait_semaphores},
        {"vkWaitSemaphoresKHR", &wait_semaphores, (Function)our_wait_semaphores},
        {"vkWaitForFences", &wait_fences, (Function)our_wait_fences},
        {"vkGetSemaphoreCounterValue", &counter, (Function)our_counter},
        {"vkGetSemaphoreCounterValueKHR", &counter, (Function)our_counter},
        {"vkDeviceWaitIdle", &idle, (Function)our_idle},
        {"vkAllocateMemory", &allocate, (Function)our_allocate},
        {"vkCmdDispatch", &dispatch, (Function)our_dispatch},
    };
    Function next = next_of_device(device, name);
    for (size_t k = 0; next && k < sizeof taken / sizeof *taken; k++)
        if (!strcmp(name, taken[k].name)) {
            memcpy(taken[k].next, &next, sizeof next);
            return taken[k].ours;
        }
    return next;
}

/* Returns this layer's link, and advances the chain to the next layer. */
static struct link *take_link(const void *info, int32_t type) {
    struct chain *chain = ((const struct chain *)info)->next;
    while (chain->type != type || chain->kind != 0)
        chain = chain->next;
    struct link *link = chain->link;
    chain->link = link->next;
    return link;
}

static Result create_instance(const void *info, const void *allocator, void **instance) {
    struct link *link = take_link(info, INSTANCE_LINK);
    next_of_instance = link->instance_proc;
    Result (*next)(const void *, const void *, void **) = (void *)next_of_instance(NULL, "vkCreateInstance");
    return next(info, allocator, instance);
}

static void *the_instance;
static Result create_device(void *adapter, const void *info, const void *allocator, void **device) {
    struct link *link = take_link(info, DEVICE_LINK);
    next_of_device = link->device_proc;
    Result (*next)(void *, const void *, const void *, void **) =
        (void *)link->instance_proc(the_instance, "vkCreateDevice");
    return next(adapter, info, allocator, device);
}

static Function of_instance(void *instance, const char *name) {
    if (instance)
        the_instance = instance;
    if (!strcmp(name, "vkGetInstanceProcAddr"))
        return (Function)of_instance;
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (Function)of_device;
    if (!strcmp(name, "vkCreateInstance"))
        return (Function)create_instance;
    if (!strcmp(name, "vkCreateDevice"))
        return (Function)create_device;
    return next_of_instance ? next_of_instance(instance, name) : NULL;
}

SHOWN Result vkNegotiateLoaderLayerInterfaceVersion(struct interface *interface) {
    interface->version = 2;
    interface->instance_proc = of_instance;
    interface->device_proc = of_device;
    interface->physical_proc = NULL;
    return SUCCESS;
}
