/* Where the entries of a matrix belong: passes over millions of couplings, see gmr_traj/band. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* The largest distance in frames of two unknowns that couple, at least `most`, and how many of the couplings are of an
   unknown that belongs to no frame (-1) with another; these go to `loose`, the greater index times n and the other,
   where there is room for them (not NULL). */
int64_t layout_reach(int64_t count, const int32_t *rows, const int32_t *columns, const int64_t *frames, int64_t n,
                     int64_t *most, int64_t *loose)
{
    int64_t found = 0, largest = *most;
    for (int64_t k = 0; k < count; k++) {
        int64_t i = rows[k], j = columns[k], one = frames[i], other = frames[j];
        if (one >= 0 && other >= 0) {
            int64_t apart = one > other ? one - other : other - one;
            largest = apart > largest ? apart : largest;
        } else if (i != j) {
            if (loose)
                loose[found] = (i > j ? i : j) * n + (i > j ? j : i);
            found++;
        }
    }
    *most = largest;
    return found;
}

/* How many couplings are of two blocks, and these, the earlier block's unknown first, where there is room for them. */
int64_t layout_across(int64_t count, const int32_t *rows, const int32_t *columns, const int64_t *block,
                      const uint8_t *carried, int64_t *earlier, int64_t *later)
{
    int64_t found = 0;
    for (int64_t k = 0; k < count; k++) {
        int64_t i = rows[k], j = columns[k];
        if (block[i] == block[j] || carried[i] || carried[j])
            continue;
        if (earlier) {
            earlier[found] = block[i] < block[j] ? i : j;
            later[found] = block[i] < block[j] ? j : i;
        }
        found++;
    }
    return found;
}

typedef struct {
    int32_t rank, column; /* the front where an unknown is a pivot, and which of them */
} Pivot;

typedef struct {
    int64_t fronts, size, known;
    const Pivot *pivots;          /* (size) */
    const int64_t *height;        /* (fronts): of the panels */
    const int64_t *ahead;         /* (fronts): the row at which the next front's pivots begin */
    const int64_t *keys, *row;    /* (known): front * size + unknown, ascending, and the unknown's row there */
} Fronts;

/* The front that has an entry, and where in its panel; see BlockCholesky._places. */
void layout_places(const Fronts *fronts, int64_t count, const int32_t *rows, const int32_t *columns, int32_t *front,
                   int32_t *place)
{
    for (int64_t k = 0; k < count; k++) {
        int64_t later = columns[k];
        Pivot pivot = fronts->pivots[rows[k]], other = fronts->pivots[later];
        if (pivot.rank > other.rank || (pivot.rank == other.rank && pivot.column > other.column)) {
            Pivot swap = pivot;
            pivot = other, other = swap;
            later = rows[k];
        }
        int64_t rank = pivot.rank, row = other.column;
        if (other.rank == rank + 1 && other.rank < fronts->fronts - 1)
            row += fronts->ahead[rank];
        else if (other.rank > rank) {
            int64_t key = rank * fronts->size + later, low = 0, high = fronts->known;
            while (low < high) {
                int64_t middle = (low + high) / 2;
                if (fronts->keys[middle] < key)
                    low = middle + 1;
                else
                    high = middle;
            }
            row = fronts->row[low];
        }
        front[k] = (int32_t)rank;
        place[k] = (int32_t)(pivot.column * fronts->height[rank] + row);
    }
}

/* Shares in the order of the entries they belong to: sorted by front, by place there, and as they were given.

   first_share: of each front, to be filled; shares, places: of all, in that order.  Returns the number of entries, or
   -1 where there is no memory. */
int64_t layout_sort(int64_t count, const int32_t *front, const int32_t *place, int64_t fronts, const int64_t *sizes,
                    int64_t *first_share, int32_t *shares, int32_t *places)
{
    int64_t largest = 0, longest = 0, entries = 0;
    memset(first_share, 0, (fronts + 1) * sizeof(int64_t));
    for (int64_t k = 0; k < count; k++)
        first_share[front[k] + 1]++;
    for (int64_t f = 0; f < fronts; f++) {
        largest = sizes[f] > largest ? sizes[f] : largest;
        longest = first_share[f + 1] > longest ? first_share[f + 1] : longest;
        first_share[f + 1] += first_share[f];
    }
    int64_t *next = malloc((fronts + 1) * sizeof(int64_t));
    int32_t *begin = malloc((largest + 1) * sizeof(int32_t)), *spare = malloc((2 * longest + 1) * sizeof(int32_t));
    if (!next || !begin || !spare) {
        entries = -1;
        fronts = 0;
    } else {
        memcpy(next, first_share, fronts * sizeof(int64_t));
        for (int64_t k = 0; k < count; k++) {
            int64_t at = next[front[k]]++;
            shares[at] = (int32_t)k;
            places[at] = place[k];
        }
    }
    for (int64_t f = 0; f < fronts; f++) {
        int64_t many = first_share[f + 1] - first_share[f];
        int32_t *mine = shares + first_share[f], *where = places + first_share[f];
        memset(begin, 0, (sizes[f] + 1) * sizeof(int32_t));
        for (int64_t k = 0; k < many; k++)
            begin[where[k] + 1]++;
        for (int64_t p = 0; p < sizes[f]; p++) {
            entries += begin[p + 1] > 0;
            begin[p + 1] += begin[p];
        }
        for (int64_t k = 0; k < many; k++) {
            int32_t at = begin[where[k]]++;
            spare[at] = mine[k];
            spare[longest + at] = where[k];
        }
        memcpy(mine, spare, many * sizeof(int32_t));
        memcpy(where, spare + longest, many * sizeof(int32_t));
    }
    free(next);
    free(begin);
    free(spare);
    return entries;
}

/* The entries of sorted shares: the first of each front, and of each entry its place and its first share. */
void layout_entries(int64_t fronts, const int64_t *first_share, const int32_t *places, int64_t *first_entry,
                    int32_t *place, int32_t *first)
{
    int64_t entry = 0;
    for (int64_t f = 0; f < fronts; f++) {
        first_entry[f] = entry;
        for (int64_t k = first_share[f]; k < first_share[f + 1]; k++)
            if (k == first_share[f] || places[k] != places[k - 1]) {
                place[entry] = places[k];
                first[entry++] = (int32_t)k;
            }
    }
    first_entry[fronts] = entry;
    first[entry] = (int32_t)first_share[fronts];
}
