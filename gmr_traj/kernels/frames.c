/* A list of instructions on vectors of frames: see gmr_traj/vector_machine.py, which does the same with NumPy, number
   for number.  Functions that are not plain arithmetic are NumPy's own loops, or the C library's. */

#include <math.h>
#include <stdint.h>

/* Frames at a time: few enough for the registers to stay in the cache. */
enum { WIDTH = 128 };

/* Numbers of an instruction; operands are indices into the table of vectors. */
enum { OPERATION, ONE, OTHER, TARGET, INSTRUCTION };

/* Operations; those from LOOPS on are functions' own loops. */
enum {
    COPY, NEGATIVE, SQUARE, SQUARE_ROOT, ABSOLUTE, RECIPROCAL, LOGICAL_NOT, ADD, SUBTRACT, MULTIPLY, DIVIDE, LESS,
    LESS_EQUAL, EQUAL, NOT_EQUAL, LOGICAL_AND, LOGICAL_OR, IF_ELSE_ZERO, LOOPS
};

typedef void loop(char **, const intptr_t *, const intptr_t *, void *);

typedef struct {
    loop *run;
    void *data;
    int64_t sources;
} Loop;

/* The C library's functions as loops: what CasADi's virtual machine calls. */
#define UNARY(name, expression)                                                                                        \
    void libm_##name(char **arguments, const intptr_t *count, const intptr_t *strides, void *data)                     \
    {                                                                                                                  \
        const double *a = (const double *)arguments[0];                                                                \
        double *t = (double *)arguments[1];                                                                            \
        (void)strides, (void)data;                                                                                     \
        for (intptr_t k = 0; k < *count; k++)                                                                          \
            t[k] = (expression);                                                                                       \
    }
#define BINARY(name, function)                                                                                         \
    void libm_##name(char **arguments, const intptr_t *count, const intptr_t *strides, void *data)                     \
    {                                                                                                                  \
        const double *a = (const double *)arguments[0], *b = (const double *)arguments[1];                             \
        double *t = (double *)arguments[2];                                                                            \
        (void)strides, (void)data;                                                                                     \
        for (intptr_t k = 0; k < *count; k++)                                                                          \
            t[k] = function(a[k], b[k]);                                                                               \
    }

UNARY(exp, exp(a[k]))
UNARY(log, log(a[k]))
UNARY(sin, sin(a[k]))
UNARY(cos, cos(a[k]))
UNARY(tan, tan(a[k]))
UNARY(arcsin, asin(a[k]))
UNARY(arccos, acos(a[k]))
UNARY(arctan, atan(a[k]))
UNARY(tanh, tanh(a[k]))
UNARY(floor, floor(a[k]))
UNARY(ceil, ceil(a[k]))
UNARY(sign, a[k] < 0.0 ? -1.0 : a[k] > 0.0 ? 1.0 : a[k])
BINARY(power, pow)
BINARY(fmin, fmin)
BINARY(fmax, fmax)
BINARY(arctan2, atan2)
BINARY(copysign, copysign)

int64_t frames_width(void) { return WIDTH; }

/* A target may be a source, too, but entry by entry. */
#define EACH(expression)                                                                                               \
    _Pragma("GCC ivdep") for (int64_t k = 0; k < n; k++)                                                                                    \
        t[k] = (expression);                                                                                           \
    break

static void step(const int32_t *instruction, double *const *table, int64_t n, const Loop *loops)
{
    const double *a = table[instruction[ONE]], *b = table[instruction[OTHER]];
    double *t = table[instruction[TARGET]];
    switch (instruction[OPERATION]) {
    case COPY: EACH(a[k]);
    case NEGATIVE: EACH(-a[k]);
    case SQUARE: EACH(a[k] * a[k]);
    case SQUARE_ROOT: EACH(sqrt(a[k]));
    case ABSOLUTE: EACH(fabs(a[k]));
    case RECIPROCAL: EACH(1.0 / a[k]);
    case LOGICAL_NOT: EACH(a[k] == 0.0);
    case ADD: EACH(a[k] + b[k]);
    case SUBTRACT: EACH(a[k] - b[k]);
    case MULTIPLY: EACH(a[k] * b[k]);
    case DIVIDE: EACH(a[k] / b[k]);
    case LESS: EACH(a[k] < b[k]);
    case LESS_EQUAL: EACH(a[k] <= b[k]);
    case EQUAL: EACH(a[k] == b[k]);
    case NOT_EQUAL: EACH(a[k] != b[k]);
    case LOGICAL_AND: EACH((a[k] != 0.0) & (b[k] != 0.0));
    case LOGICAL_OR: EACH((a[k] != 0.0) | (b[k] != 0.0));
    case IF_ELSE_ZERO: EACH(a[k] != 0.0 ? b[k] : 0.0);
    default: {
        const Loop *numpy = loops + (instruction[OPERATION] - LOOPS);
        intptr_t count = n, strides[3] = {sizeof(double), sizeof(double), sizeof(double)};
        char *arguments[3] = {(char *)a, numpy->sources == 2 ? (char *)b : (char *)t, (char *)t};
        numpy->run(arguments, &count, strides, numpy->data);
    }
    }
}

typedef struct {
    int64_t count, constants, registers, unknowns, vectors;
    const int32_t *list;     /* (count, INSTRUCTION) */
    const int32_t *constant; /* registers that are constants */
    const double *value;     /* of the constants */
    double *const *vector;   /* inputs but the first, and outputs, from frame 0 on */
    const int64_t *columns;  /* (unknowns, frames): which of the unknowns the entries of the first input are */
    int64_t frames;
    const Loop *loops;
} Program;

/* Run the list in frames begin <= k < end.

   x: the unknowns.
   space: for the registers and the first input, WIDTH numbers each.
   table: for the addresses of the registers, the inputs and the outputs. */
void frames_run(const Program *program, const double *x, int64_t begin, int64_t end, double *space, double **table)
{
    int64_t registers = program->registers, near = registers + program->unknowns;
    for (int64_t k = 0; k < near; k++)
        table[k] = space + k * WIDTH;
    for (int64_t k = 0; k < program->constants; k++)
        for (int64_t i = 0; i < WIDTH; i++)
            table[program->constant[k]][i] = program->value[k];
    for (int64_t first = begin; first < end; first += WIDTH) {
        int64_t n = end - first < WIDTH ? end - first : WIDTH;
        for (int64_t k = 0; k < program->unknowns; k++)
            for (int64_t i = 0; i < n; i++)
                table[registers + k][i] = x[program->columns[k * program->frames + first + i]];
        for (int64_t k = 0; k < program->vectors; k++)
            table[near + k] = program->vector[k] + first;
        for (int64_t s = 0; s < program->count; s++)
            step(program->list + s * INSTRUCTION, table, n, program->loops);
    }
}
