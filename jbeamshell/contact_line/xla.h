/* Handlers of XLA's foreign function interface: what of its C interface, version 0.1, they need.

   XLA gives a handler its arrays with the axes of all batches in front; axes of length 1 serve all
   lanes of a batch. */

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

typedef struct Extension { size_t size; int type; struct Extension *next; } Extension;
typedef struct { size_t size; Extension *extension; int major, minor; } Version;
typedef struct { size_t size; Version version; } Metadata;
typedef struct { Extension base; Metadata *metadata; } MetadataExtension;
typedef struct { size_t size; Extension *extension; int type; void *data; int64_t rank, *dims; } Buffer;
typedef struct { size_t size; Extension *extension; int64_t count; int *types; Buffer **buffers; } Buffers;
typedef struct {
    size_t size;
    Extension *extension;
    const void *api;
    void *context;
    int stage;
    Buffers args, rets;
} CallFrame;

enum { METADATA = 1, MOST_AXES = 8 };

/* True where XLA asks a handler for its version, which is then given. */
static int asks_version(const CallFrame *frame) {
    if (frame->extension == NULL || frame->extension->type != METADATA) return 0;
    Metadata *metadata = ((MetadataExtension *)frame->extension)->metadata;
    metadata->version.major = 0, metadata->version.minor = 1;
    return 1;
}

/* Number of an array in a buffer for one lane; axes of length 1 serve all lanes. */
static int64_t number_in(const Buffer *b, int rank, int64_t lane, const Buffer *first) {
    int64_t axes = b->rank - rank, index[MOST_AXES], number = 0;
    for (int64_t d = axes - 1; d >= 0; --d) index[d] = lane % first->dims[d], lane /= first->dims[d];
    for (int64_t d = 0; d < axes; ++d) number = number * b->dims[d] + (b->dims[d] == 1 ? 0 : index[d]);
    return number;
}

static int64_t product_of(const int64_t *dims, int64_t count) {
    int64_t product = 1;
    for (int64_t d = 0; d < count; ++d) product *= dims[d];
    return product;
}
