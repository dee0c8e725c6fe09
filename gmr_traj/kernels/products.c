/* H = S' W S of every frame, lower triangle: see gmr_traj/band/products.py, which does the same in the same order. */

#include <stdint.h>
#include <string.h>

/* Frames at a time. */
enum { FRAMES = 16 };

typedef struct {
    int64_t rows, columns;      /* of S; W is rows by rows, symmetric */
    const int64_t *begin;       /* (columns + 1): the first entry of each column of S */
    const int64_t *row;         /* of each entry of S, ascending in a column */
    const double *factor;       /* entries of S, column after column, frames in a row */
    const double *const *weight; /* (rows, rows): entries of W, NULL where there is none */
    int64_t frames;             /* the length of a row */
    double *product;            /* entries of H, row after row of its lower triangle */
} Products;

int64_t products_width(void) { return FRAMES; }

/* In frames begin <= k < end; space is for rows * columns * FRAMES numbers. */
void products_run(const Products *of, int64_t begin, int64_t end, double *space)
{
    for (int64_t first = begin; first < end; first += FRAMES) {
        int64_t n = end - first < FRAMES ? end - first : FRAMES;
        memset(space, 0, of->rows * of->columns * FRAMES * sizeof(double));
        for (int64_t j = 0; j < of->columns; j++) /* T = W S */
            for (int64_t e = of->begin[j]; e < of->begin[j + 1]; e++) {
                const double *s = of->factor + e * of->frames + first;
                for (int64_t a = 0; a < of->rows; a++) {
                    const double *w = of->weight[a * of->rows + of->row[e]];
                    double *t = space + (j * of->rows + a) * FRAMES;
                    if (w)
                        for (int64_t k = 0; k < n; k++)
                            t[k] += w[first + k] * s[k];
                }
            }
        double *out = of->product + first;
        for (int64_t i = 0; i < of->columns; i++)
            for (int64_t j = 0; j <= i; j++, out += of->frames) {
                double sum[FRAMES] = {0.0};
                for (int64_t e = of->begin[i]; e < of->begin[i + 1]; e++) {
                    const double *s = of->factor + e * of->frames + first;
                    const double *t = space + (j * of->rows + of->row[e]) * FRAMES;
                    for (int64_t k = 0; k < n; k++)
                        sum[k] += s[k] * t[k];
                }
                for (int64_t k = 0; k < n; k++)
                    out[k] = sum[k];
            }
    }
}
