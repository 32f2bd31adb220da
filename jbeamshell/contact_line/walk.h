/* Walk of a body along load paths: what walk.c finds and slopes.c differentiates. */

#include "xla.h"

#define R restrict /* vectors that do not overlap */

enum { ALONG, AGAINST, STICK, OPEN, CLOSE, KINDS };
enum { BY_ROW, AT_ONCE, AT_RETURN, FIXED };
enum { MOST_VERTICES = 8, MOST_EVENTS = 40, DENSE = 3, PRODUCT = 3 }; /* times the nodes */

static const double MOST_PART = 0.6, UNEVEN = 3.0, STARTS = 0.25;

/* State of a contact, or an event in it: as good as no two have one key. */
typedef struct { uint64_t a, b; } Key;

/* Columns of a tableau over their pivots, with the pivot behind each.  They depend on the state of
   the contact and on the event alone, so that branches, cycles and loads of one body share them.
   The first ones have a place in a table; those of ``now`` are of this body. */
enum { TABLE = 1 << 13, BLOCK = 64, MOST_REALS = 1 << 21 };
typedef struct {
    int m, blocks, used, kept, most, failed;
    unsigned now, *since;
    Key *key;
    double **column, **block, *spare;
} Columns;

/* Exchanges of rows and columns. */
typedef struct {
    int count, room, whole;              /* whole: those that undo each other stay, too */
    double **share, *add, *rest, *pivot; /* share: (m,) each */
    int *row, *normal;
} Product;

/* Contact where a branch begins, and what it remembers; see walk.py. */
typedef struct {
    double *v, *r, *lift, load, displacement; /* (k,), (m,), (n,) */
    double *side, *extra, *extra_before, sense, length, closed;
    unsigned char *free, turned, settled;
} Contact;

/* Branch, or a part of one, that begins with a contact and ends at a target or where a loop closes.
   It ends beside its target if it splits; it is the first that turns back; it goes on with the one
   before; its extra friction is that of the cycle before, again. */
typedef struct { double sense, end; int turns, closes, splits, first, goes_on, again; } Course;

/* Event that was found. */
typedef struct { double tau; int kind, node, cause, vertex, keep; } Event;

/* Part of a branch as it was walked; levels from ``begin`` to ``end`` were read on it. */
typedef struct {
    Contact from;
    Course course;
    int target, begin, end, number, events;
    Event *event;
    int *before, *after, *node;
    unsigned char *way;
    double *at, *change, *force;
    void *memory;
} Part;

/* Parts of a path in their order, for derivatives; without memory it has failed. */
typedef struct { int count, room, events, failed; Part *parts; Event *event; } Tape;

/* What a path knows. */
typedef struct {
    int n, k, m, vertices;             /* nodes, those that may slip, fields, room */
    int places;                        /* nodes with a position: bearings have none */
    const double *K, *x;               /* (m, m) symmetric, (places,) */
    double mu, c, slides;
    Product product, *now;
    Columns *columns;
    Key state;
    /* branch: equations, tableau */
    double *r_0, *lift, *pull, *extra; /* (m,), (n,), (m,), (2, k) */
    double *answer, *rate, *held, *sigma, *open, back, tau; /* open (n,): 1 or 0 */
    double *wait;                      /* (n,) for the next event of each node */
    unsigned char *lifted;             /* (n,) open where the branch begins */
    /* polygon */
    int number, *before, *after, *node, *last; /* last (KINDS, n) */
    unsigned char *way;
    double *at, *change, *force, *pulled, *rise, *whole, *part_before, *part_behind, *begins;
    /* slip of a branch */
    double *side, *later_side;
    unsigned char *stuck, *opened, *sliding;
    int *later, ended;
    double *column;
    Tape *tape; /* null where nobody asks for derivatives */
} Walk;

typedef struct { double *v, *r_t, *r_n, *displacement, *lift, *work; unsigned char *slipping, *settled; } Levels;

/* Path of a body, its arguments in the order of native.py. */
enum { ARGUMENTS = 12 };
static const int ARGUMENT_RANKS[ARGUMENTS] = {2, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 0};
typedef struct {
    const double *K, *f, *x, *mu, *c, *v, *r, *lift, *start, *loads;
    const unsigned char *turn, *rounded;
} Given;

/* Room for paths of n nodes, of which k may slip; without memory opening it fails. */
typedef struct {
    Walk walk;
    Columns columns;
    Contact contacts[3];
    double *change;
    unsigned char *flags;
    void *memory;
} Desk;

typedef struct { int edge, slides; double work; } Reading;

/* Extra friction of a node, its place in (2, k), and its slopes to friction and to the node's forces. */
typedef struct { int place; double value, mu, r_t, r_n; } Extra;

/* Rounded corner at a load and the area under it, each less those of the sharp one, with slopes to
   the parts before and behind; the area's slope to the load is the corner itself. */
typedef struct { int counts, inside; double value, load, before, behind, area, area_before, area_behind; } Round;

/* Memory in pieces: its bytes are counted first, with no memory, and then taken. */
typedef struct { char *at; size_t used; } Room;

double dot(const double *R a, const double *R b, int m);
void *take(Room *room, size_t bytes);
#define REALS(count) take(room, (size_t)(count) * sizeof(double))
#define WHOLES(count) take(room, (size_t)(count) * sizeof(int))
#define FLAGS(count) take(room, (size_t)(count))

Contact contact_in(Room *room, int k, int n);
int open_desk(Desk *desk, int k, int n, int places);
void product_in(Room *room, Product *p, int exchanges);
void close_desk(Desk *desk);
Given given_of(Buffer **in, int64_t lane, const Buffer *first, int64_t *numbers);
void run(Desk *desk, const Given *given, int same_body, int levels, Levels out);

void begin(Walk *w);
void advance(Walk *w, double tau);
void change_contact(Walk *w, int kind, int node, int keeps);
void exchanged(const Product *p, int e, int m, double *R a);
int moves(const Walk *w, int r);

int first_front(const Walk *w);
Extra extra_at(const Walk *w, const Contact *from, int i);
int edge_of(const Walk *w, double tau);
Round round_at(double x, double a, double b);
double share_of(const Walk *w, int j);
void corners(Walk *w, int rounded);
double level(const Walk *w, const Contact *from, const Course *course, double load, double *change, Contact *at, unsigned char *slipping);
