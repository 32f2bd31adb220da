/* Load paths of a body on its contact line: events, polygon and spline of each branch.

   The same walk as walk.py, polygon.py, events.py and spline.py, which explain it; names are theirs.
   One difference: no tableau is kept.  An event needs one of its columns, and that follows from the
   column of the stiffness by the events before it (product form of the inverse).  A column depends on
   the state of the contact alone, so that it is found once for all branches and loads of a body.
   A path has no global state and calls nothing but the C library.  Numbers are doubles. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "walk.h"

static const double ABOUT = 2.0, SLIDES = 1e6, SLIDES_ON = 1e-2, TOUCHES = 1e-9, SAME = 1e-9;
static const double ROUNDING = 32.0 * 2.220446049250313e-16;
static const double LATE = 1e-9, MERGED = 1e-9;

/* --- room -------------------------------------------------------------------------------------- */

void *take(Room *room, size_t bytes) {
    void *found = room->at == NULL ? NULL : room->at + room->used;
    room->used += (bytes + 63) / 64 * 64;
    return found;
}

void product_in(Room *room, Product *p, int exchanges) {
    p->count = p->whole = 0, p->room = exchanges;
    p->share = take(room, (size_t)exchanges * sizeof(double *));
    p->add = REALS(exchanges), p->rest = REALS(exchanges), p->pivot = REALS(exchanges);
    p->row = WHOLES(exchanges), p->normal = WHOLES(exchanges);
}

Contact contact_in(Room *room, int k, int n) {
    Contact c;
    memset(&c, 0, sizeof c);
    c.v = REALS(k), c.r = REALS(k + n), c.lift = REALS(n), c.side = REALS(k);
    c.extra = REALS(2 * k), c.extra_before = REALS(2 * k), c.free = FLAGS(k);
    return c;
}

/* Sum of products in eight parts, which processors add side by side. */
double dot(const double *R a, const double *R b, int m) {
    double s[8] = {0.0};
    int r = 0;
    for (; r + 8 <= m; r += 8)
        for (int i = 0; i < 8; ++i) s[i] += a[r + i] * b[r + i];
    for (; r < m; ++r) s[0] += a[r] * b[r];
    return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
}

/* --- columns ----------------------------------------------------------------------------------- */

static uint64_t mixed(uint64_t x) { /* the last step of splitmix64 */
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* Puts a number into a key; the second time takes it out again. */
static void mark(Key *key, uint64_t number) {
    key->a ^= mixed(number + 0x9e3779b97f4a7c15u), key->b ^= mixed(number + 0x3c6ef372fe94f82au);
}

static void mark_node(Key *state, int node, double sigma, double open) {
    int now = (sigma > 0.0 ? 1 : sigma < 0.0 ? 2 : 0) + (open != 0.0 ? 3 : 0);
    if (now > 0) mark(state, 6 * (uint64_t)node + (uint64_t)now);
}

static void forget_columns(Columns *c) { ++c->now, c->used = c->kept = 0; }

/* Room for a column and its pivot. */
static double *new_column(Columns *c) {
    int place = c->used / BLOCK;
    if (place == c->blocks) {
        double **more = realloc(c->block, ((size_t)place + 1) * sizeof *more);
        double *block = more == NULL ? NULL : malloc(BLOCK * ((size_t)c->m + 1) * sizeof(double));
        if (more != NULL) c->block = more;
        if (block == NULL) {
            c->failed = 1;
            return c->spare;
        }
        c->block[place] = block, ++c->blocks;
    }
    return c->block[place] + (size_t)(c->used++ % BLOCK) * ((size_t)c->m + 1);
}

/* Place of a key in the table, empty if it is new; null where the table is full. */
static double **place_of(Columns *c, Key key) {
    size_t i = key.a % TABLE;
    for (; c->since[i] == c->now; i = (i + 1) % TABLE)
        if (c->key[i].a == key.a && c->key[i].b == key.b) return &c->column[i];
    if (c->kept == c->most) return NULL;
    ++c->kept, c->since[i] = c->now, c->key[i] = key, c->column[i] = NULL;
    return &c->column[i];
}

/* --- product form of the inverse --------------------------------------------------------------- */

/* A vector after an exchange. */
void exchanged(const Product *p, int e, int m, double *R a) {
    const double *R share = p->share[e];
    int i = p->row[e], q = p->normal[e];
    double entry = a[i] + p->add[e] * a[q];
    if (entry != 0.0)
        for (int r = 0; r < m; ++r) a[r] -= share[r] * entry;
    a[i] = (p->rest[e] != 0.0 ? p->rest[e] * a[q] : 0.0) - entry / p->pivot[e];
}

/* Column j of the tableau. */
static void column(const double *K, const Product *p, int m, int j, double *R a) {
    int e = p->count - 1;
    while (e >= 0 && p->row[e] != j) --e; /* the last exchange that made this column */
    memcpy(a, e < 0 ? K + (size_t)j * m : p->share[e], m * sizeof(double));
    for (++e; e < p->count; ++e) exchanged(p, e, m, a);
}

/* Adds the exchange of an event to the product form. */
static void add_exchange(Walk *w, Key state, int kind, int node) {
    Product *p = w->now;
    int m = w->m, q = w->k + node, i = kind < OPEN ? node : q, e = p->count;
    double add = kind == ALONG ? w->mu : kind == AGAINST ? -w->mu : 0.0;
    double rest = kind == STICK ? -w->sigma[node] * w->mu : 0.0;
    mark(&state, ((uint64_t)1 << 40) + KINDS * (uint64_t)node + (uint64_t)kind);
    double *own = NULL, **found = place_of(w->columns, state);
    if (found == NULL) found = &own;
    if (*found == NULL) {
        double *share = *found = new_column(w->columns);
        column(w->K, p, m, i, w->column);
        double pivot = w->column[i] + add * w->column[q];
        for (int r = 0; r < m; ++r) share[r] = w->column[r] / pivot;
        share[i] = 1.0 / pivot + (rest != 0.0 ? rest * share[q] : 0.0);
        share[m] = pivot;
    }
    p->share[e] = *found, p->pivot[e] = (*found)[m];
    p->row[e] = i, p->normal[e] = q, p->add[e] = add, p->rest[e] = rest;
    p->count = e + 1;
}

/* --- tableau ----------------------------------------------------------------------------------- */

/* Product form anew, of the nodes that slip and that are open. */
static void rebuild(Walk *w) {
    Key state = {0, 0};
    w->now->count = 0;
    for (int i = 0; i < w->k; ++i)
        if (w->sigma[i] != 0.0) {
            add_exchange(w, state, w->sigma[i] > 0.0 ? ALONG : AGAINST, i);
            mark_node(&state, i, w->sigma[i], 0.0);
        }
    for (int i = 0; i < w->n; ++i)
        if (w->open[i] != 0.0) {
            add_exchange(w, state, OPEN, i);
            mark_node(&state, i, w->sigma[i], 0.0), mark_node(&state, i, w->sigma[i], 1.0);
        }
}

void change_contact(Walk *w, int kind, int node, int keeps) {
    Product *p = w->now;
    if (p->count == p->room) rebuild(w);
    int e = p->count, q = w->k + node, i = kind < OPEN ? node : q;
    add_exchange(w, w->state, kind, node);
    exchanged(p, e, w->m, w->rate);
    /* An event that undoes the one before leaves what was before both. */
    int undoes = !p->whole && e > 0 && p->row[e - 1] == i && p->add[e - 1] == -p->rest[e] && p->rest[e - 1] == -p->add[e];
    if (undoes) p->count = e - 1;

    double answer = w->answer[i] + p->add[e] * w->answer[q];
    w->answer[i] = w->held[i] + (p->rest[e] != 0.0 ? p->rest[e] * w->answer[q] : 0.0);
    w->held[i] = kind <= STICK || keeps ? answer : kind == CLOSE ? -w->lift[node] : 0.0;
    mark_node(&w->state, node, w->sigma[node], w->open[node]);
    if (kind < OPEN) w->sigma[node] = kind == ALONG ? 1.0 : kind == AGAINST ? -1.0 : 0.0;
    else w->open[node] = kind == OPEN ? 1.0 : 0.0;
    mark_node(&w->state, node, w->sigma[node], w->open[node]);
}

void begin(Walk *w) {
    if (w->columns->kept == w->columns->most) forget_columns(w->columns);
    memcpy(w->answer, w->r_0, w->m * sizeof(double));
    for (int r = 0; r < w->m; ++r) w->rate[r] = -w->pull[r], w->held[r] = 0.0;
    for (int i = 0; i < w->n; ++i) w->sigma[i] = w->open[i] = 0.0;
    w->tau = 0.0, w->now->count = 0, w->state = (Key){0, 0};
    for (int i = 0; i < w->n; ++i)
        if (w->lifted[i]) {
            if (i < w->k) change_contact(w, w->answer[i] > 0.0 ? AGAINST : ALONG, i, 1);
            change_contact(w, OPEN, i, 1);
        }
}

int moves(const Walk *w, int r) { return r < w->k ? w->sigma[r] != 0.0 : w->open[r - w->k] != 0.0; }

void advance(Walk *w, double tau) {
    double step = tau - w->tau;
    for (int r = 0; r < w->m; ++r) w->answer[r] += w->rate[r] * step;
    w->tau = tau;
}

/* --- events ------------------------------------------------------------------------------------ */

/* The waits of all nodes are found side by side, without branches; the events of the node that waits
   least are then gone through one by one, because those at one load have an order. */

static double until(double room, double change) {
    double some = room > 0.0 ? room : 0.0, size = change < 0.0 ? -change : 1.0, wait = some / size;
    return change < 0.0 ? wait : INFINITY;
}

/* Wait of a node that sticks for its slip to one side: with more friction than its own, unless that
   lasts until the branch has gone back for as long as the one before. */
static double slips_after(double room, double more, double change, double rest) {
    double wait = until(room + more, change), own = until(room, change);
    double late = own > rest ? own : rest;
    return wait >= rest ? late : wait;
}

static inline void find_waits(const Walk *w, double rest, int returns) {
    int k = w->k;
    double mu = w->mu, *R wait = w->wait;
    const double *R force = w->answer, *R normal = w->answer + k, *R slip = w->rate, *R fall = w->rate + k;
    const double *R held = w->held + k, *R lift = w->lift, *R sigma = w->sigma, *R open = w->open;
    const double *R along = w->extra, *R against = w->extra + k;
    for (int i = 0; i < k; ++i) {
        double up = mu * fall[i] + slip[i], down = mu * fall[i] - slip[i];
        double room_up = mu * normal[i] + force[i], room_down = mu * normal[i] - force[i];
        double a = returns ? slips_after(room_up, along[i], up, rest) : until(room_up + along[i], up);
        double b = returns ? slips_after(room_down, against[i], down, rest) : until(room_down + against[i], down);
        double stuck = a < b ? a : b, apart = open[i] * lift[i] + normal[i], moving = until(apart, fall[i]);
        double turns = sigma[i] * slip[i] < 0.0 ? 0.0 : moving, rises = fall[i] > 0.0 ? 0.0 : moving;
        double opened = held[i] > 0.0 ? rises : moving, slipping = sigma[i] != 0.0 ? turns : stuck;
        wait[i] = open[i] != 0.0 ? opened : slipping;
    }
    for (int i = k; i < w->n; ++i) {
        int rises = held[i] > 0.0 && fall[i] > 0.0;
        wait[i] = open[i] == 0.0 ? until(normal[i], fall[i]) : rises ? 0.0 : until(lift[i] + normal[i], fall[i]);
    }
}

static double least_of(const double *R a, int count) {
    double s[8];
    int i = 0;
    for (int j = 0; j < 8; ++j) s[j] = INFINITY;
    for (; i + 8 <= count; i += 8)
        for (int j = 0; j < 8; ++j) s[j] = a[i + j] < s[j] ? a[i + j] : s[j];
    for (; i < count; ++i) s[0] = a[i] < s[0] ? a[i] : s[0];
    for (int j = 1; j < 8; ++j) s[0] = s[j] < s[0] ? s[j] : s[0];
    return s[0];
}

/* Takes an event that comes after a wait, ``tau`` of the best, if it is earlier. */
static void earlier(Event *best, double wait, int kind, int node, int cause) {
    int first = wait < best->tau || (wait == best->tau && wait < INFINITY &&
                (kind < best->kind || (kind == best->kind && node < best->node)));
    if (first) best->tau = wait, best->kind = kind, best->node = node, best->cause = cause;
}

/* True if so little friction is left that the node slips at once. */
static int is_late(const Walk *w, double room) {
    double most = 0.0;
    for (int i = 0; i < w->k && room < 0.0; ++i) most = fmax(most, w->mu * w->answer[w->k + i]);
    return room < -LATE * most;
}

static void events_of(const Walk *w, int i, double rest, Event *best) {
    int k = w->k;
    double normal = w->answer[k + i], fall = w->rate[k + i];
    if (w->open[i] != 0.0) {
        if (w->held[k + i] > 0.0 && fall > 0.0) earlier(best, 0.0, CLOSE, i, AT_ONCE);
        else earlier(best, until(w->lift[i] + normal, fall), CLOSE, i, BY_ROW);
    } else if (i >= k || w->sigma[i] != 0.0) {
        if (i < k && w->sigma[i] * w->rate[i] < 0.0) earlier(best, 0.0, STICK, i, AT_ONCE);
        earlier(best, until(normal, fall), OPEN, i, BY_ROW);
    } else
        for (int kind = ALONG; kind <= AGAINST; ++kind) {
            double side = kind == ALONG ? 1.0 : -1.0, more = w->extra[kind * k + i];
            double change = w->mu * fall + side * w->rate[i];
            if (change >= 0.0) continue;
            double room = w->mu * normal + side * w->answer[i];
            int ends = until(room + more, change) >= rest, comes = ends && until(room, change) < rest;
            int cause = comes ? AT_RETURN : is_late(w, ends ? room : room + more) ? AT_ONCE : BY_ROW;
            earlier(best, slips_after(room, more, change, rest), kind, i, cause);
        }
}

static Event next_event(const Walk *w) {
    double rest = w->back - w->tau;
    Event best = {INFINITY, KINDS, w->n, FIXED, 0, 0};
    if (rest < INFINITY) find_waits(w, rest, 1);
    else find_waits(w, rest, 0);
    double least = least_of(w->wait, w->n);
    for (int i = 0; i < w->n && least < INFINITY; ++i)
        if (w->wait[i] == least) events_of(w, i, rest, &best);
    best.tau += w->tau;
    return best;
}

/* --- polygon ----------------------------------------------------------------------------------- */

static void set_vertex(Walk *w, int place) {
    int m = w->m, k = w->k, n = w->n;
    double *R slip = w->change + (size_t)place * m, *R rise = slip + k, mu = w->mu;
    double *R force = w->force + (size_t)place * m, *R normal = force + k;
    const double *R answer = w->answer, *R held = w->held, *R sigma = w->sigma, *R open = w->open;
    w->at[place] = w->tau;
    for (int i = 0; i < n; ++i) {
        double a = answer[k + i], b = held[k + i];
        rise[i] = open[i] != 0.0 ? a : b, normal[i] = open[i] != 0.0 ? b : a;
    }
    for (int i = 0; i < k; ++i) {
        double a = answer[i], b = held[i], limit = b - sigma[i] * mu * normal[i];
        slip[i] = sigma[i] != 0.0 ? a : b, force[i] = sigma[i] != 0.0 ? limit : a;
    }
}

static int with_vertex(Walk *w, double reach) {
    int last = w->number - 1, dense = w->number > DENSE * w->n;
    double close = (dense ? 0.5 / w->n : MERGED) * reach;
    int place = w->tau - w->at[last] > close ? last + 1 : last;
    if (place > 0) {
        if (place > last) w->before[place] = w->after[place] = w->node[place] = w->way[place] = 0;
        set_vertex(w, place);
    }
    w->number = place + 1;
    return place;
}

static void with_neighbours(Walk *w, int kind, int node, int vertex) {
    int *row = w->last + kind * w->n;
    int below = node > 0 ? row[node - 1] : -1, above = node < w->n - 1 ? row[node + 1] : -1;
    if (below >= vertex) below = -1;
    if (above >= vertex) above = -1;
    int found = below > above ? below : above;
    if (kind != STICK && found > 0 && node < w->k) {
        if (w->before[vertex] == 0)
            w->before[vertex] = found, w->node[vertex] = node, w->way[vertex] = below == found;
        if (w->after[found] == 0) w->after[found] = vertex;
    }
    row[node] = vertex;
}

static void with_slip(Walk *w, const Event *event, int vertex, double reach) {
    int node = event->node, kind = event->kind;
    if (node >= w->k) return;
    double side = kind == ALONG ? 1.0 : -1.0;
    if (event->tau <= reach) {
        if (kind < STICK) w->side[node] = side;
        if (kind <= STICK) w->stuck[node] = kind == STICK;
        if (kind >= OPEN) w->opened[node] = 1;
    } else if (kind < STICK && w->later[node] == 0)
        w->later[node] = vertex, w->later_side[node] = side;
}

/* Vertex at which the first front starts that goes on; a front that starts behind it is late. */
int first_front(const Walk *w) {
    int j = 1;
    while (j < w->number && (w->before[j] != 0 || w->after[j] == 0)) ++j;
    return j;
}

/* Load up to which events are needed: those that may round a corner at the branch's end. */
static double horizon(const Walk *w, double reach) {
    double most = reach;
    int first = first_front(w);
    for (int j = 1; j < w->number; ++j) {
        double step = w->at[j] - w->at[w->before[j]];
        int late = w->before[j] == 0 && j > first;
        if (w->after[j] != 0 || w->at[j] - (late ? STARTS : MOST_PART) * step >= reach) continue;
        if (late) {
            most = fmax(most, w->at[j] + STARTS / (1.0 - MOST_PART) * step);
            continue;
        }
        most = fmax(most, w->at[j] + UNEVEN * MOST_PART / (1.0 - MOST_PART) * step);
        if (w->before[j] > 0) most = fmax(most, reach + UNEVEN * MOST_PART * step);
    }
    return most;
}

static double velocity(const Walk *w) {
    double sum = 0.0;
    for (int r = 0; r < w->m; ++r)
        if (moves(w, r)) sum += w->pull[r] * w->rate[r];
    return fabs(sum);
}

static void note(Tape *tape, Event event, int vertex, int keep) {
    if (tape == NULL) return;
    event.vertex = vertex, event.keep = keep;
    tape->event[tape->events++] = event;
}

/* Polygon of a branch up to tau = reach, and a little beyond. */
static void polygon(Walk *w, double reach) {
    int n = w->n, k = w->k, events = 0, most = MOST_EVENTS * n;
    begin(w);
    w->number = 1, w->at[0] = 0.0, w->before[0] = w->after[0] = w->node[0] = w->way[0] = 0;
    memset(w->change, 0, w->m * sizeof(double));
    memcpy(w->force, w->r_0, w->m * sizeof(double));
    for (int i = 0; i < KINDS * n; ++i) w->last[i] = -1;
    for (int i = 0; i < k; ++i) {
        w->side[i] = w->later_side[i] = 0.0, w->later[i] = 0;
        w->stuck[i] = 0, w->opened[i] = w->lifted[i];
    }
    Event event = next_event(w);
    while ((event.tau <= reach || event.tau <= horizon(w, reach)) && events < most - 1 && w->number < w->vertices - 2 &&
           !(w->tau >= reach && velocity(w) > SLIDES_ON * w->slides)) {
        advance(w, event.tau);
        int keep = event.kind == CLOSE && w->rate[k + event.node] > 0.0;
        int vertex = with_vertex(w, reach);
        note(w->tape, event, vertex, keep);
        with_neighbours(w, event.kind, event.node, vertex);
        change_contact(w, event.kind, event.node, keep);
        with_slip(w, &event, vertex, reach);
        event = next_event(w), ++events;
    }
    w->ended = (event.tau > reach || w->tau >= reach) && !w->columns->failed;
    /* A vertex at the next event, or anywhere beyond, ends the last edge. */
    double reached = fmax(reach, w->tau), anywhere = reached > 0.0 ? 2.0 * reached : 1.0;
    int comes = event.tau - w->tau > MERGED * reached && event.tau < anywhere, place = w->number++;
    if (!comes) event.tau = anywhere, event.kind = KINDS, event.node = 0, event.cause = FIXED;
    advance(w, event.tau);
    w->before[place] = w->after[place] = w->node[place] = w->way[place] = 0;
    set_vertex(w, place);
    note(w->tape, event, place, 0);
}

/* --- spline ------------------------------------------------------------------------------------ */

/* Corners where the body slides as a whole stay sharp; sums for the work of friction. */
static void prepare(Walk *w) {
    int m = w->m, last = w->number - 1;
    for (int j = 0; j <= last; ++j) w->pulled[j] = dot(w->change + (size_t)j * m, w->pull, m);
    w->whole[0] = 0.0, w->rise[last] = 0.0, w->sliding[last] = 0;
    for (int j = 0; j < last; ++j) {
        double step = w->at[j + 1] - w->at[j];
        w->rise[j] = (w->pulled[j + 1] - w->pulled[j]) / step;
        w->whole[j + 1] = w->whole[j] + step * (w->pulled[j] + 0.5 * w->rise[j] * step);
        w->sliding[j] = fabs(w->rise[j]) > w->slides;
    }
    for (int j = 0; j <= last; ++j)
        if (w->sliding[j] || (j > 0 && w->sliding[j - 1])) w->part_before[j] = w->part_behind[j] = 0.0;
}

/* Part of the step to a vertex that is nearer to it than to the vertex before. */
double share_of(const Walk *w, int j) {
    int i = w->node[j];
    double part = 0.5;
    if (i > 0 && i < w->places - 1) {
        double a = fabs(w->x[i] - w->x[i - 1]), b = fabs(w->x[i + 1] - w->x[i]);
        part = a + b > 0.0 ? b / (a + b) : 0.5;
    }
    part = w->way[j] ? part : 1.0 - part;
    return fmin(fmax(part, 1.0 - MOST_PART), MOST_PART);
}

/* Parts of the rounded corners before and behind each vertex; zero for sharp ones. */
void corners(Walk *w, int rounded) {
    int last = w->number - 1, first = first_front(w);
    for (int j = 0; j <= last; ++j) w->begins[j] = share_of(w, j);
    for (int j = 0; j <= last; ++j) { /* what lies before a vertex of its step, and behind */
        int b = w->before[j], a = w->after[j];
        w->part_before[j] = (w->at[j] - w->at[b]) * w->begins[j];
        w->part_behind[j] = (w->at[a] - w->at[j]) * (1.0 - w->begins[a]);
    }
    memcpy(w->whole, w->part_before, (last + 1) * sizeof(double));
    for (int j = 0; j <= last; ++j) {
        int starts = w->before[j] == 0, ends = w->after[j] == 0;
        double ahead = w->part_behind[j];
        double room = j > first ? STARTS * w->at[j] : w->at[j];
        double half = starts ? fmin(room, ahead) : fmin(w->whole[j], UNEVEN * w->whole[w->before[j]]);
        if (ends) ahead = half;
        int is_round = rounded && j < last && !(starts && ends);
        w->part_before[j] = is_round ? fmin(half, UNEVEN * ahead) : 0.0;
        w->part_behind[j] = is_round ? fmin(ahead, UNEVEN * half) : 0.0;
        w->begins[j] = w->at[j] - w->part_before[j];
    }
    prepare(w);
}

Round round_at(double x, double a, double b) {
    Round o = {0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    o.counts = a > 0.0 && b > 0.0 && x > -a, o.inside = o.counts && x < b;
    if (!o.counts) return o;
    if (!o.inside) {
        o.area = a * b / 6.0, o.area_before = b / 6.0, o.area_behind = a / 6.0;
        return o;
    }
    double s = (x + a) / a, t = s / (1.0 + sqrt(1.0 + (b - a) / a * s)), sharp = fmax(x, 0.0);
    double slope = 2.0 * a + 2.0 * (b - a) * t, mean = 2.0 * a / 3.0 + 0.5 * (b - a) * t;
    double to_a = (1.0 - t) * (1.0 - t) / slope, to_b = -t * t / slope;
    o.value = b * t * t - sharp;
    o.load = 2.0 * b * t / slope - (x > 0.0 ? 1.0 : 0.0);
    o.before = 2.0 * b * t * to_a, o.behind = t * t + 2.0 * b * t * to_b;
    o.area = b * t * t * t * mean - 0.5 * sharp * sharp;
    o.area_before = b * t * t * t * (2.0 / 3.0 - 0.5 * t) + b * t * t * slope * to_a;
    o.area_behind = t * t * t * mean + 0.5 * b * t * t * t * t + b * t * t * slope * to_b;
    return o;
}

/* Edge of the polygon on which a load lies. */
int edge_of(const Walk *w, double tau) {
    int edge = 0, last = w->number - 2;
    while (edge < last && w->at[edge + 1] < tau) ++edge;
    return edge;
}

/* Contact (m,) at a load of the branch: change of the fields and forces. */
static Reading read_at(const Walk *w, double tau, double *R change, double *R force) {
    int m = w->m, edge = edge_of(w, tau), last = w->number - 2;
    double since = tau - w->at[edge], step = w->at[edge + 1] - w->at[edge], part = since / step;
    const double *R q_0 = w->change + (size_t)edge * m, *R q_1 = q_0 + m;
    const double *R r_0 = w->force + (size_t)edge * m, *R r_1 = r_0 + m;
    for (int r = 0; r < m; ++r) {
        change[r] = q_0[r] + part * (q_1[r] - q_0[r]);
        force[r] = r_0[r] + part * (r_1[r] - r_0[r]);
    }
    double under = w->whole[edge] + since * (w->pulled[edge] + 0.5 * w->rise[edge] * since);
    for (int j = 1; j <= last; ++j) {
        Round o = round_at(tau - w->at[j], w->part_before[j], w->part_behind[j]);
        if (!o.counts) continue;
        under += o.area * (w->rise[j] - w->rise[j - 1]);
        if (!o.inside) continue;
        double ahead = o.value / (w->at[j + 1] - w->at[j]), behind = o.value / (w->at[j] - w->at[j - 1]);
        const double *R q = w->change + (size_t)j * m, *R f = w->force + (size_t)j * m;
        for (int r = 0; r < m; ++r) {
            change[r] += ahead * (q[r + m] - q[r]) - behind * (q[r] - q[r - m]);
            force[r] += ahead * (f[r + m] - f[r]) - behind * (f[r] - f[r - m]);
        }
    }
    double moved = dot(change, w->pull, m), stored = 0.5 * (dot(change, w->r_0, m) + dot(change, force, m));
    return (Reading){edge, w->sliding[edge], 0.5 * tau * moved - under - stored};
}

/* --- path -------------------------------------------------------------------------------------- */

/* Extra friction of a node of a branch that turns back, see polygon.py. */
Extra extra_at(const Walk *w, const Contact *from, int i) {
    int slipped = from->side[i] != 0.0;
    double side = slipped ? from->side[i] : from->r[i] > 0.0 ? -1.0 : 1.0;
    double used = -side * from->r[i], reaction = from->r[w->k + i], left = w->mu * reaction - used;
    int place = (side < 0.0 ? 0 : w->k) + i;
    if (from->free[i] || (!slipped && fmin(left, ABOUT * used) <= 0.0)) return (Extra){place, 0.0, 0.0, 0.0, 0.0};
    if (slipped || left < ABOUT * used) return (Extra){place, left, reaction, side, w->mu};
    return (Extra){place, ABOUT * used, 0.0, -ABOUT * side, 0.0};
}

static Course depart(Walk *w, const Contact *from, const double *f, double target, int rounded) {
    int k = w->k, m = w->m, n = w->n;
    Course course;
    course.sense = target >= from->load ? 1.0 : -1.0;
    course.turns = course.sense * from->sense < 0.0;
    course.goes_on = course.sense * from->sense > 0.0;
    double reach = fabs(target - from->load);
    int loops = course.turns && from->turned;
    course.splits = loops && reach * (1.0 - SAME) > from->length;
    course.end = course.splits ? from->load + course.sense * from->length : target;
    course.closes = loops && reach * (1.0 + SAME) >= from->length;
    course.first = course.turns && !from->turned;
    course.again = course.closes && from->closed >= 2.0;
    for (int r = 0; r < m; ++r) w->pull[r] = course.sense * f[r];
    memcpy(w->r_0, from->r, m * sizeof(double));
    memcpy(w->lift, from->lift, n * sizeof(double));
    w->now = &w->product;
    w->back = course.first ? from->length : INFINITY;
    memset(w->extra, 0, 2 * k * sizeof(double));
    if (rounded && course.again)
        memcpy(w->extra, from->extra_before, 2 * k * sizeof(double));
    else if (rounded && course.turns)
        for (int i = 0; i < k; ++i) {
            Extra more = extra_at(w, from, i);
            w->extra[more.place] = more.value;
        }
    for (int i = 0; i < n; ++i) w->lifted[i] = from->lift[i] > 0.0;
    polygon(w, fabs(course.end - from->load));
    corners(w, rounded);
    return course;
}

/* Level of a course at a load: contact in ``at``, and work since it began. */
double level(const Walk *w, const Contact *from, const Course *course, double load, double *change, Contact *at, unsigned char *slipping) {
    int k = w->k, m = w->m, n = w->n;
    double tau = course->sense * (load - from->load), most = 0.0;
    Reading read = read_at(w, tau, change, at->r);
    for (int i = 0; i < n; ++i) at->lift[i] = from->lift[i] + change[k + i];
    for (int i = k; i < m; ++i) most = fmax(most, at->r[i]);
    double moved = dot(change, w->pull, m);
    /* Rounding leaves open nodes a little force: the shorter the elements, the more. */
    for (int i = 0; i < n; ++i) {
        int q = k + i;
        double least_n = fmax(TOUCHES * most, ROUNDING * w->K[(size_t)q * m + q] * fabs(change[q]));
        if (!(at->lift[i] > 0.0 && !(at->r[q] > least_n))) continue;
        at->r[q] = 0.0;
        if (i < k) {
            double least_t = fmax(TOUCHES * most, ROUNDING * w->K[(size_t)i * m + i] * fabs(change[i]));
            if (fabs(at->r[i]) <= least_t) at->r[i] = 0.0;
        }
    }
    for (int i = 0; i < k; ++i) {
        at->v[i] = from->v[i] + change[i];
        const double *q = w->change + (size_t)read.edge * m + i;
        slipping[i] = q[m] != q[0] && at->lift[i] <= 0.0;
    }
    at->load = load;
    at->displacement = from->displacement + w->c * (load - from->load) + course->sense * moved;
    at->settled = from->settled && w->ended && !read.slides;
    return read.work;
}

/* What a contact at the end of a course remembers. */
static void arrive(const Walk *w, const Contact *from, const Course *course, Contact *at) {
    int k = w->k, goes_on = course->goes_on;
    double length = fabs(at->load - from->load);
    for (int i = 0; i < k; ++i) {
        int j = w->later[i], part = j > 0 && w->begins[j] < length;
        double side = part ? w->later_side[i] : w->side[i];
        int stays = (w->stuck[i] && !part) || w->opened[i];
        at->side[i] = goes_on && side == 0.0 && !stays ? from->side[i] : side;
        at->free[i] = stays || (goes_on && from->free[i] && side == 0.0);
    }
    at->sense = course->sense;
    at->length = goes_on ? from->length + length : length;
    at->turned = goes_on ? from->turned : course->turns;
    at->closed = course->closes ? from->closed + 1.0 : 0.0;
    memcpy(at->extra, goes_on ? from->extra : w->extra, 2 * k * sizeof(double));
    memcpy(at->extra_before, goes_on ? from->extra_before : from->extra, 2 * k * sizeof(double));
}

static void swap(Contact *a, Contact *b) {
    Contact c = *a;
    *a = *b, *b = c;
}

static void copy_contact(Contact *a, const Contact *b, int k, int n) {
    Contact c = *b;
    c.v = a->v, c.r = a->r, c.lift = a->lift, c.side = a->side, c.free = a->free;
    c.extra = a->extra, c.extra_before = a->extra_before;
    memcpy(c.v, b->v, k * sizeof(double)), memcpy(c.r, b->r, (k + n) * sizeof(double));
    memcpy(c.lift, b->lift, n * sizeof(double)), memcpy(c.side, b->side, k * sizeof(double));
    memcpy(c.extra, b->extra, 2 * k * sizeof(double)), memcpy(c.free, b->free, k);
    memcpy(c.extra_before, b->extra_before, 2 * k * sizeof(double));
    *a = c;
}

/* Keeps a part of a branch on the tape. */
static void keep(const Walk *w, const Contact *from, const Course *course, int target, int begin, int end) {
    Tape *tape = w->tape;
    if (tape->count == tape->room) {
        int more = 2 * tape->room + 8;
        Part *parts = realloc(tape->parts, (size_t)more * sizeof(Part));
        if (parts != NULL) tape->parts = parts, tape->room = more;
    }
    Part part = {.course = *course, .target = target, .begin = begin, .end = end, .number = w->number, .events = tape->events};
    Room whole = {NULL, 0}, *room = &whole;
    size_t v = (size_t)w->number, m = (size_t)w->m;
    for (int pass = 0; pass < 2 && tape->count < tape->room; ++pass) {
        part.from = contact_in(room, w->k, w->n);
        part.event = take(room, (size_t)part.events * sizeof(Event));
        part.before = WHOLES(v), part.after = WHOLES(v), part.node = WHOLES(v), part.way = FLAGS(v);
        part.at = REALS(v), part.change = REALS(v * m), part.force = REALS(v * m);
        if (pass == 0) part.memory = whole.at = malloc(whole.used), whole.used = 0;
        if (whole.at == NULL) break;
    }
    tape->events = 0;
    if (part.memory == NULL) {
        tape->failed = 1;
        return;
    }
    copy_contact(&part.from, from, w->k, w->n);
    memcpy(part.event, tape->event, (size_t)part.events * sizeof(Event));
    memcpy(part.before, w->before, v * sizeof(int)), memcpy(part.after, w->after, v * sizeof(int));
    memcpy(part.node, w->node, v * sizeof(int)), memcpy(part.way, w->way, v);
    memcpy(part.at, w->at, v * sizeof(double));
    memcpy(part.change, w->change, v * m * sizeof(double));
    memcpy(part.force, w->force, v * m * sizeof(double));
    tape->parts[tape->count++] = part;
}

/* Levels of a path from the contact ``from``. */
static void path(Walk *w, Contact *from, Contact *to, const double *f, int levels, const double *load,
                 const unsigned char *turn, int rounded, Levels out, double *change, unsigned char *slipping) {
    int k = w->k, n = w->n;
    Contact spare = to[1];
    for (int begin = 0, end; begin < levels; begin = end) {
        for (end = begin + 1; end < levels && !turn[end];) ++end;
        double target = load[end - 1], done = 0.0, before = 0.0;
        for (int part = 0, next = begin; part < 2 && next < end; ++part) {
            int first = next;
            Course course = depart(w, from, f, target, rounded);
            for (; next < end && course.sense * (load[next] - course.end) <= 0.0; ++next) {
                double work = done + level(w, from, &course, load[next], change, &spare, slipping);
                memcpy(out.v + (size_t)next * k, spare.v, k * sizeof(double));
                memcpy(out.r_t + (size_t)next * k, spare.r, k * sizeof(double));
                memcpy(out.r_n + (size_t)next * n, spare.r + k, n * sizeof(double));
                memcpy(out.lift + (size_t)next * n, spare.lift, n * sizeof(double));
                memcpy(out.slipping + (size_t)next * k, slipping, k);
                out.displacement[next] = spare.displacement, out.settled[next] = spare.settled;
                out.work[next] = work - before, before = work;
            }
            if (w->tape) keep(w, from, &course, end - 1, first, next);
            done += level(w, from, &course, course.end, change, to, slipping);
            arrive(w, from, &course, to);
            swap(from, to);
        }
    }
}

/* --- desk -------------------------------------------------------------------------------------- */

static void walk_in(Room *room, Walk *w) {
    int n = w->n, k = w->k, m = w->m, v = w->vertices;
    product_in(room, &w->product, PRODUCT * n);
    w->r_0 = REALS(m), w->lift = REALS(n), w->pull = REALS(m), w->extra = REALS(2 * k);
    w->answer = REALS(m), w->rate = REALS(m), w->held = REALS(m), w->sigma = REALS(n);
    w->open = REALS(n), w->wait = REALS(n), w->lifted = FLAGS(n), w->column = REALS(m);
    w->before = WHOLES(v), w->after = WHOLES(v), w->node = WHOLES(v), w->last = WHOLES(KINDS * n);
    w->way = FLAGS(v), w->at = REALS(v), w->change = REALS((size_t)v * m), w->force = REALS((size_t)v * m);
    w->pulled = REALS(v), w->rise = REALS(v), w->whole = REALS(v), w->part_before = REALS(v);
    w->part_behind = REALS(v), w->begins = REALS(v), w->sliding = FLAGS(v);
    w->side = REALS(k), w->later_side = REALS(k), w->stuck = FLAGS(k), w->opened = FLAGS(k);
    w->later = WHOLES(k);
}

/* Load from which on a body slides as a whole, as a change of the displacement per load. */
static double slides(const double *K, const double *f, double c, int m) {
    double square = 0.0, whole = 0.0;
    for (int r = 0; r < m; ++r) square += f[r] * f[r], whole += f[r] * f[r] * K[(size_t)r * m + r];
    return SLIDES * (fabs(c) + square / (whole > 0.0 ? whole : 1.0));
}

static void columns_in(Room *room, Columns *c, int m) {
    c->since = take(room, TABLE * sizeof(unsigned)), c->key = take(room, TABLE * sizeof(Key));
    c->column = take(room, TABLE * sizeof(double *)), c->spare = REALS(m + 1);
}

void close_desk(Desk *desk) {
    for (int i = 0; i < desk->columns.blocks; ++i) free(desk->columns.block[i]);
    free(desk->columns.block), free(desk->memory);
    desk->columns.blocks = 0, desk->columns.block = NULL, desk->memory = NULL;
}

int open_desk(Desk *desk, int k, int n, int places) {
    Room whole = {NULL, 0}, *room = &whole;
    Walk *w = &desk->walk;
    int reals = MOST_REALS / (k + n + 1);
    desk->memory = NULL;
    desk->columns = (Columns){.m = k + n, .most = reals < TABLE / 2 ? reals : TABLE / 2, .now = 1};
    w->n = n, w->k = k, w->m = k + n, w->places = places, w->vertices = MOST_VERTICES * n;
    w->tape = NULL, w->columns = &desk->columns;
    for (int pass = 0; pass < 2; ++pass) { /* counts first, and then takes */
        walk_in(room, w);
        columns_in(room, &desk->columns, k + n);
        for (int i = 0; i < 3; ++i) desk->contacts[i] = contact_in(room, k, n);
        desk->change = REALS(k + n), desk->flags = FLAGS(k);
        if (pass == 0) whole.at = malloc(whole.used), whole.used = 0;
        if (whole.at == NULL) return 0;
    }
    desk->memory = whole.at;
    memset(desk->columns.since, 0, TABLE * sizeof(unsigned));
    return 1;
}

void run(Desk *desk, const Given *given, int same_body, int levels, Levels out) {
    Walk *w = &desk->walk;
    int k = w->k, n = w->n, m = w->m;
    Contact *from = &desk->contacts[0];
    if (!same_body) forget_columns(&desk->columns);
    w->K = given->K, w->x = given->x, w->mu = *given->mu, w->c = *given->c;
    w->slides = slides(given->K, given->f, w->c, m);
    memcpy(from->v, given->v, k * sizeof(double)), memcpy(from->r, given->r, m * sizeof(double));
    memcpy(from->lift, given->lift, n * sizeof(double));
    memset(from->side, 0, k * sizeof(double)), memset(from->free, 0, k);
    memset(from->extra, 0, 2 * k * sizeof(double)), memset(from->extra_before, 0, 2 * k * sizeof(double));
    from->load = given->start[0], from->displacement = given->start[1], from->settled = 1;
    from->sense = from->length = from->closed = 0.0, from->turned = 0;
    path(w, from, from + 1, given->f, levels, given->loads, given->turn, *given->rounded, out, desk->change, desk->flags);
}

/* Levels of one path, for callers without XLA; 0 without memory. */
API int jbeamshell_path(int k, int n, int places, int levels, const Given *given, const Levels *out) {
    Desk desk;
    if (!open_desk(&desk, k, n, places)) return 0;
    run(&desk, given, 0, levels, *out);
    close_desk(&desk);
    return 1;
}

/* --- handler for XLA ---------------------------------------------------------------------------- */

/* Path of a lane, and the numbers of its arrays in their buffers. */
Given given_of(Buffer **in, int64_t lane, const Buffer *first, int64_t *numbers) {
    const void *at[ARGUMENTS];
    for (int i = 0; i < ARGUMENTS; ++i) {
        int64_t size = product_of(in[i]->dims + in[i]->rank - ARGUMENT_RANKS[i], ARGUMENT_RANKS[i]);
        numbers[i] = number_in(in[i], ARGUMENT_RANKS[i], lane, first);
        at[i] = (const char *)in[i]->data + numbers[i] * size * (i < 10 ? (int64_t)sizeof(double) : 1);
    }
    return (Given){at[0], at[1], at[2], at[3], at[4], at[5], at[6], at[7], at[8], at[9], at[10], at[11]};
}

/* Paths of many lanes, one after the other; lanes of one body share its columns. */
API void *jbeamshell_walk(CallFrame *frame) {
    if (asks_version(frame)) return NULL;
    Buffer **in = frame->args.buffers, **out = frame->rets.buffers;
    int64_t axes = in[0]->rank - 2, lanes = product_of(out[0]->dims, axes), body = -1;
    int m = (int)in[1]->dims[axes], n = (int)in[7]->dims[axes], k = m - n, levels = (int)in[9]->dims[axes];
    Desk desk;
    int opened = open_desk(&desk, k, n, (int)in[2]->dims[axes]);
    for (int64_t lane = 0; lane < lanes; ++lane) {
        int64_t numbers[ARGUMENTS];
        Given given = given_of(in, lane, out[0], numbers);
        double *r[6];
        for (int i = 0; i < 6; ++i) r[i] = (double *)out[i]->data + lane * product_of(out[i]->dims + axes, out[i]->rank - axes);
        Levels to = {r[0], r[1], r[2], r[3], r[4], r[5], (unsigned char *)out[6]->data + lane * levels * k,
                     (unsigned char *)out[7]->data + lane * levels};
        if (!opened) { /* no memory */
            memset(to.settled, 0, levels);
            continue;
        }
        int64_t own = numbers[0] * product_of(in[3]->dims, axes) + numbers[3]; /* of body and friction */
        run(&desk, &given, own == body, levels, to);
        body = own;
    }
    close_desk(&desk);
    return NULL;
}
