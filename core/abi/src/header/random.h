/* ---- random numbers ----
 *
 * All that a plugin draws must follow from the key of the call. The generator is xoshiro256++, each word of whose
 * state is the first number of SplitMix64 from a word of the key, so that keys that differ in a bit give sequences
 * that have nothing in common.
 *
 * References: Blackman and Vigna, ACM Trans. Math. Softw. 47 (2021) 36; Steele, Lea and Flood, Proc. OOPSLA (2014)
 * 453; https://prng.di.unimi.it.
 */

/* The state of the generator: for one thread. */
typedef struct LacunaRandom {
    /* The state of xoshiro256++; not all words are zero. */
    uint64_t words[4];
} LacunaRandom;

/* The next number of SplitMix64. */
static inline uint64_t lacuna_splitmix64(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* The generator at the beginning of the sequence of a key. */
static inline LacunaRandom lacuna_random(LacunaKey key)
{
    LacunaRandom random;
    size_t i;
    for (i = 0; i < 4; ++i) {
        random.words[i] = lacuna_splitmix64(&key.words[i]);
    }
    return random;
}

/* The next 64 bits. */
static inline uint64_t lacuna_bits(LacunaRandom *random)
{
    uint64_t *s = random->words;
    const uint64_t sum = s[0] + s[3], bits = ((sum << 23) | (sum >> 41)) + s[0], shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = (s[3] << 45) | (s[3] >> 19);
    return bits;
}

/* A number from the uniform distribution on [0, 1): a multiple of 2^-53. It can be 0, not 1. */
static inline double lacuna_uniform(LacunaRandom *random)
{
    return (double)(lacuna_bits(random) >> 11) / 9007199254740992.0;
}

/* A number from the standard normal distribution, by the method of Box and Muller from two uniform ones. */
static inline double lacuna_normal(LacunaRandom *random)
{
    const double radius = sqrt(-2.0 * log(1.0 - lacuna_uniform(random)));
    return radius * cos(6.283185307179586 * lacuna_uniform(random));
}
