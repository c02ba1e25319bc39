// Packets through one slab in the manner of PyXOpto's layered kernel: single precision, Marsaglia's
// multiply with carry, work items that fetch packets from one counter, roulette below 1e-4. Left out, in its
// favour: boundaries of other indices, layers, path lengths, detectors fed by atomic sums.
// ALONG_THE_PATH absorbs along the path instead of at collisions.
#define ROULETTE_WEIGHT 1e-4f
#define ROULETTE_CHANCE 0.1f
#define MULTIPLIER 4294957665UL

inline float uniform_number(ulong *state)
{
    *state = (*state & 0xffffffffUL) * MULTIPLIER + (*state >> 32);
    return ((float)((uint)*state >> 8) + 0.5f) * 0x1p-24f;
}

inline float3 turned(float3 u, float mu, float azimuth)
{
    float cosine, sine = sincos(azimuth, &cosine);
    float across = sqrt(fmax(0.0f, 1.0f - mu * mu));
    if (fabs(u.z) > 0.99999f)
        return (float3)(across * cosine, across * sine, copysign(mu, mu * u.z));
    float level = sqrt(1.0f - u.z * u.z), scale = across / level;
    return (float3)(scale * (u.x * u.z * cosine - u.y * sine) + u.x * mu,
                    scale * (u.y * u.z * cosine + u.x * sine) + u.y * mu,
                    -across * cosine * level + u.z * mu);
}

__kernel void slab(const uint packets, const float scattering, const float absorption, const float g,
                   const float thickness, __global uint *launched, __global ulong *states,
                   __global double *sums)
{
    const size_t item = get_global_id(0);
    ulong state = states[item];
    double through = 0.0, through_square = 0.0, back = 0.0;
#ifdef ALONG_THE_PATH
    const float mean_path = 1.0f / scattering;
#else
    const float mean_path = 1.0f / (scattering + absorption);
    const float albedo = scattering * mean_path;
#endif
    while (atomic_inc(launched) < packets) {
        float3 place = (float3)(0.0f), direction = (float3)(0.0f, 0.0f, 1.0f);
        float weight = 1.0f;
        for (;;) {
            float step = -log(uniform_number(&state)) * mean_path;
            float z = place.z + step * direction.z;
            const bool out = z >= thickness || z < 0.0f;
            if (out)
                step = ((z < 0.0f ? 0.0f : thickness) - place.z) / direction.z;
            place += step * direction;
#ifdef ALONG_THE_PATH
            weight *= exp(-absorption * step);
#endif
            if (out) {
                if (z < 0.0f) {
                    back += weight;
                } else {
                    through += weight;
                    through_square += weight * weight;
                }
                break;
            }
#ifndef ALONG_THE_PATH
            weight *= albedo;
#endif
            float ratio = (1.0f - g * g) / (1.0f - g + 2.0f * g * uniform_number(&state));
            float mu = clamp((1.0f + g * g - ratio * ratio) / (2.0f * g), -1.0f, 1.0f);
            direction = turned(direction, mu, 6.2831853f * uniform_number(&state));
            if (weight < ROULETTE_WEIGHT) {
                if (uniform_number(&state) > ROULETTE_CHANCE)
                    break;
                weight /= ROULETTE_CHANCE;
            }
        }
    }
    states[item] = state;
    sums[3 * item] = through;
    sums[3 * item + 1] = through_square;
    sums[3 * item + 2] = back;
}
